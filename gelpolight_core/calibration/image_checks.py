"""Checks of the image files of a session."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import QualityTable, judge
from gelpolight_core.image.image_file import names_of
from gelpolight_core.image.linear_image import LinearImage, require_size
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.session.inventory import StoredImage
from gelpolight_core.session.session import Session
from gelpolight_core.session.session_images import read_linear_image, require_colour
from gelpolight_core.stages.checkerboards.board_search import find_rough_corners


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
        image = read_linear_image(path)
        size = size or image.size
        require_size(image.size, size, where=str(path))
        if colour:
            require_lit_colours(image, session, where=str(path))
    added = [StoredImage.of(path) for path in files]
    refuse_copies(added)
    captured = [image for folder in folders for image in session.inventory.stage(folder).images]
    by_hash = {image.sha256: image for image in captured}
    for image_file in added:
        twin = by_hash.get(image_file.sha256)
        if twin is not None:
            text = f"The image is already in the session, as {twin.name}"
            raise InputError(text, image_file.path, Remedy.CHOOSE_FILE)


def refuse_copies(images: Iterable[StoredImage]) -> None:
    """Refuse an image that occurs twice in a session: noise makes any two captures differ.

    A copied image means that a stage was not captured, such as the background copied to the
    whiteboard. No later figure would show this.

    Raises
    ------
    InputError
        If two of the files have the same content.
    """
    by_hash: dict[str, StoredImage] = {}
    for image in images:
        first = by_hash.setdefault(image.sha256, image)
        if first is not image:
            raise InputError(
                f"The image is a copy of {first.name}", image.path, Remedy.CAPTURE_AGAIN
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


def image_size(session: Session, folders: Sequence[str]) -> tuple[int, int] | None:
    """Return width and height of the session's images, or None if there are none yet.

    A damaged image is refused by its own stage.
    """
    sizes = (image.size_px for folder in folders for image in session.stored(folder))
    return next((size for size in sizes if size is not None), None)


def judge_image_files(session: Session, folders: Collection[str]) -> QualityTable:
    """Judge the files in the folders of a session. There are no figures if all are as usual.

    Parameters
    ----------
    session : Session
        Session with the folders.
    folders : collection of str
        Folders of the images that are used.
    """
    figures = []
    lossy: dict[str, float] = {}
    for image in (image for folder in folders for image in session.stored(folder)):
        name, loss = image.compression
        if loss:
            lossy[name] = max(loss, lossy.get(name, 0.0))
    if lossy:
        text = f"Rounding by compression of the images ({', '.join(sorted(lossy))})"
        figures.append(judge("compression_grey_levels", text, max(lossy.values()), "grey levels"))
    others = [path for folder in folders for path in session.inventory.stage(folder).others]
    if others:
        figures.append(
            judge(
                "files_not_read",
                "Files that are not images",
                float(len(others)),
                warn=0.0,
                remedy=f"Not read: {names_of(others)}. Save them as PNG or TIFF, or remove them",
            )
        )
    return QualityTable(tuple(figures))
