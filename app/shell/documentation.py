"""Find the pages of the documentation, which every installation has."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "gelpolight-studio"


def find_documentation(root: Path = ROOT) -> Path | None:
    """Return the folder of the Markdown pages, or None if there is none.

    Parameters
    ----------
    root : Path, optional
        The folder of the program. A checkout and a frozen program contain the pages; a wheel
        installs them with the shared files of its environment.
    """
    if (root / "docs" / "index.md").is_file():
        return root / "docs"
    try:
        installed = files(PACKAGE) or ()
    except PackageNotFoundError:
        return None
    for file in installed:
        if file.name == "index.md" and PACKAGE in file.parts:
            return Path(str(file.locate())).resolve().parent
    return None
