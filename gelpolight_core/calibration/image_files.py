"""What the image files of a session are: losses by compression, and files that are no images."""

from __future__ import annotations

from collections.abc import Collection

from gelpolight_core.finding import QualityTable, judge
from gelpolight_core.image.file import files_in, format_of, names_of, read_image_file
from gelpolight_core.session.session import Session


def judge_image_files(session: Session, folders: Collection[str]) -> QualityTable:
    """Judge the files in the folders of a session; there are no figures where all are as usual.

    Parameters
    ----------
    session : Session
        With the folders.
    folders : collection of str
        Of the images that are used.
    """
    figures = []
    lossy: dict[str, float] = {}
    for path in (path for folder in folders for path in session.found(folder)):
        form = format_of(data := read_image_file(path))
        if form is not None and (loss := form.loss(data)):
            lossy[form.name] = max(loss, lossy.get(form.name, 0.0))
    if lossy:
        text = f"Rounding by compression of the images ({', '.join(sorted(lossy))})"
        figures.append(judge("compression_grey_levels", text, max(lossy.values()), "grey levels"))
    others = [path for folder in folders for path in files_in(session.folder / folder).others]
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
