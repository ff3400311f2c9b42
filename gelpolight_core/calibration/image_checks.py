"""Check whether an image fits into a session before it is added."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.image.linear import LinearImage, require_size
from gelpolight_core.optics.board_search import find_rough_corners
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.session.file_hashes import file_hash, refuse_copies
from gelpolight_core.session.images import read_image, require_colour
from gelpolight_core.session.session import Session


def refuse_unfit(
    session: Session, folders: Sequence[str], files: Sequence[Path], *, colour: bool
) -> None:
    """Refuse files that cannot be images of this session.

    Parameters
    ----------
    session : Session
        The target session.
    folders : sequence of str
        Folders of all its stages.
    files : sequence of Path
        Files in any folder.
    colour : bool
        Whether the target stage needs colours.

    Raises
    ------
    InputError
        If a file is not an image, differs in size from the session's images, is grey where the LEDs
        are identified by colour, or is already in the session.
    """
    size = image_size(session, folders)
    for path in files:
        image = read_image(path)
        size = size or image.size
        require_size(image.size, size, where=str(path))
        if colour:
            require_lit_colours(image, session, where=str(path))
    refuse_copies(files)
    known = {file_hash(path): path for folder in folders for path in session.captured(folder)}
    for path in files:
        twin = known.get(file_hash(path))
        if twin is not None:
            raise InputError(
                "The image is already in the session, as {name}".format(
                    name=f"{twin.parent.name}/{twin.name}"
                ),
                path,
                Remedy.CHOOSE_FILE,
            )


def require_lit_colours(image: LinearImage, session: Session, *, where: str) -> None:
    """Refuse a grey image of the lit sensor. The likely cause is a board that is still there.

    Raises
    ------
    InputError
        If the image is grey; it names the checkerboard if there is one in it.
    """
    try:
        require_colour(image, where=where)
    except InputError:
        refuse_board(image, (session.top_pose, session.checkerboard), where=where)
        raise


def refuse_board(image: LinearImage, boards: Sequence[BoardSpec], *, where: str) -> None:
    """Raise InputError if an image shows one of some checkerboards."""
    grey = image.rgb.mean(axis=2)
    for inner_corners in {board.inner_corners for board in boards}:
        if find_rough_corners(grey, inner_corners) is not None:
            raise InputError("the checkerboard is still in the image", where, Remedy.REMOVE_BOARD)


def refuse_other_size(session: Session, folders: Sequence[str], size: tuple[int, int]) -> None:
    """Refuse an image whose width and height differ from the session's images.

    Raises
    ------
    InputError
        If there are images and their size is different.
    """
    wanted = image_size(session, folders)
    if wanted is not None:
        require_size(size, wanted, where="camera")


def image_size(session: Session, folders: Sequence[str]) -> tuple[int, int] | None:
    """Return width and height of the session's images; None if there are none yet."""
    for folder in folders:
        for path in session.found(folder):
            try:
                return read_image(path).size
            except InputError:
                continue  # a damaged image is refused by its own stage
    return None
