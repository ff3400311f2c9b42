"""Where the documentation is: the site where it was built, else the pages that it is made of."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PLACES = ("site/index.html", "docs/index.md")


def find_documentation(root: Path = ROOT) -> Path | None:
    """Return the first page of the documentation; None where there is none.

    Parameters
    ----------
    root : Path, optional
        The folder that holds the program; a package has the site there, a checkout may.
    """
    return next((root / place for place in PLACES if (root / place).is_file()), None)
