"""The pages of the documentation, which packaging/docs.sh makes for every installation."""

from __future__ import annotations

from pathlib import Path

from gelpolight_core.base.errors import InputError

SITE = Path(__file__).resolve().parents[2] / "resources" / "site"
# Page of the documentation for each page of the program.
OF_PAGE = {
    "start": "guide/first-start",
    "sensors": "guide/validate",
    "calibrate": "guide/calibrate",
    "inspect": "guide/inspect",
    "measure": "guide/measure",
}


def find_page(name: str) -> Path:
    """Return the file of a page, such as ``guide/calibrate``.

    Raises
    ------
    InputError
        If the pages were not made.
    """
    file = SITE / f"{name}.html"
    if not file.is_file():
        advice = "Make the pages with packaging/docs.sh, or read the docs folder of the source code"
        raise InputError("The documentation is not installed", file, advice)
    return file
