"""Check whether an image fits into a session before it is added."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gelpolight_core.calibration.inputs import FOLDERS, Stage
from gelpolight_core.errors import InputError
from gelpolight_core.image.file import FILE_LIMIT
from gelpolight_core.io.reading import read_file
from gelpolight_core.session.file_hashes import file_hash, refuse_copies
from gelpolight_core.session.images import SessionImages, read_image, require_colour
from gelpolight_core.translation import tr

COLOUR_STAGES = (Stage.LIGHTS, Stage.RADIANCE, Stage.BACKGROUND, Stage.BALLS)


def refuse_unfit(session: SessionImages, stage: Stage, files: Sequence[Path]) -> None:
    """Refuse files that cannot be images of a stage of this session.

    Parameters
    ----------
    session : SessionImages
        The target session.
    stage : Stage
        The target stage.
    files : sequence of Path
        Files in any folder.

    Raises
    ------
    InputError
        If a file is not an image, differs in size from the session's images, is grey where the LEDs
        are identified by colour, or is already in the session.
    """
    size = image_size(session)
    for path in files:
        image = read_image(path)
        size = size or image.size
        _refuse_size(image.size, size, where=str(path))
        if stage in COLOUR_STAGES:
            require_colour(image, where=str(path))
    refuse_copies(files)
    known = {file_hash(path): path for path in _captured(session)}
    for path in files:
        twin = known.get(file_hash(path))
        if twin is not None:
            raise InputError(
                tr("The image is already in the session, as {name}").format(
                    name=f"{twin.parent.name}/{twin.name}"
                ),
                where=str(path),
                advice=tr("Choose another image, or include that one again"),
            )


def refuse_other_size(session: SessionImages, size: tuple[int, int]) -> None:
    """Refuse an image whose width and height differ from the session's images.

    Raises
    ------
    InputError
        If there are images and their size is different.
    """
    wanted = image_size(session)
    if wanted is not None:
        _refuse_size(size, wanted, where=tr("camera"))


def image_size(session: SessionImages) -> tuple[int, int] | None:
    """Return width and height of the session's images; None if there are none yet."""
    for folder in FOLDERS.values():
        for path in session.found(folder):
            try:
                return read_image(path).size
            except InputError:
                continue  # a damaged image is refused by its own stage
    return None


def read_bytes(path: Path) -> bytes:
    """Return the content of a file.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        return read_file(path, FILE_LIMIT)
    except OSError as error:
        raise InputError(
            tr("The file cannot be read ({reason})").format(reason=error.strerror or error),
            where=str(path),
            advice=tr("Check its permissions and the disk"),
        ) from error


def _captured(session: SessionImages) -> list[Path]:
    return [path for folder in FOLDERS.values() for path in session.captured(folder)]


def _refuse_size(size: tuple[int, int], wanted: tuple[int, int], *, where: str) -> None:
    if size != wanted:
        raise InputError(
            tr("The image has {a} pixels, but the images of the session have {b}").format(
                a="x".join(map(str, size)), b="x".join(map(str, wanted))
            ),
            where=where,
            advice=tr("Capture all images of a session with the same camera and size"),
        )
