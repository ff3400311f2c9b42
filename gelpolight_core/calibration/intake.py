"""Whether a picture fits into a session, asked before it is taken in."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gelpolight_core.calibration.inputs import FOLDERS, Stage
from gelpolight_core.errors import InputError
from gelpolight_core.reading import read_file
from gelpolight_core.session.copies import file_hash, refuse_copies
from gelpolight_core.session.session import Session, read_picture, require_colour
from gelpolight_core.session.wholeness import FILE_LIMIT
from gelpolight_core.translation import tr

COLOUR_STAGES = (Stage.LIGHTS, Stage.RADIANCE, Stage.BACKGROUND, Stage.BALLS)


def refuse_unfit(session: Session, stage: Stage, files: Sequence[Path]) -> None:
    """Refuse files that cannot be pictures of a stage of this session.

    Parameters
    ----------
    session : Session
        Into which they shall go.
    stage : Stage
        For which.
    files : sequence of Path
        Anywhere.

    Raises
    ------
    InputError
        If a file is no picture, is of another size than the session's, is grey where the LEDs are
        told by their colour, or is in the session already.
    """
    size = picture_size(session)
    for path in files:
        picture = read_picture(path)
        size = size or picture.size
        _refuse_size(picture.size, size, where=str(path))
        if stage in COLOUR_STAGES:
            require_colour(picture, where=str(path))
    refuse_copies(files)
    known = {file_hash(path): path for path in _captured(session)}
    for path in files:
        twin = known.get(file_hash(path))
        if twin is not None:
            raise InputError(
                tr("the picture is in the session already, as {name}").format(
                    name=f"{twin.parent.name}/{twin.name}"
                ),
                where=str(path),
                advice=tr("Choose another picture, or take that one in again"),
            )


def refuse_other_size(session: Session, size: tuple[int, int]) -> None:
    """Refuse a picture of another size, width and height in pixels, than the session's.

    Raises
    ------
    InputError
        If there are pictures and they are of another size.
    """
    wanted = picture_size(session)
    if wanted is not None:
        _refuse_size(size, wanted, where=tr("camera"))


def picture_size(session: Session) -> tuple[int, int] | None:
    """Return width and height of a session's pictures; None where there are none yet."""
    for folder in FOLDERS.values():
        for path in session.found(folder):
            try:
                return read_picture(path).size
            except InputError:
                continue  # a damaged picture is for its own stage to refuse
    return None


def read_bytes(path: Path) -> bytes:
    """Return what a file holds.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        return read_file(path, FILE_LIMIT)
    except OSError as error:
        raise InputError(
            tr("the file cannot be read ({reason})").format(reason=error.strerror or error),
            where=str(path),
            advice=tr("Check its permissions and the disk"),
        ) from error


def _captured(session: Session) -> list[Path]:
    return [path for folder in FOLDERS.values() for path in session.captured(folder)]


def _refuse_size(size: tuple[int, int], wanted: tuple[int, int], *, where: str) -> None:
    if size != wanted:
        raise InputError(
            tr("the picture is {a} pixels and the session's pictures are {b}").format(
                a="x".join(map(str, size)), b="x".join(map(str, wanted))
            ),
            where=where,
            advice=tr("Capture all pictures of a session with one camera at one size"),
        )
