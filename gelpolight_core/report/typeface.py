"""Replace characters that the font of pages and drawings does not have."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from matplotlib import get_data_path
from matplotlib.ft2font import FT2Font

FILES = ("DejaVuSans.ttf", "DejaVuSans-Bold.ttf", "DejaVuSansMono.ttf")


@cache
def _characters() -> frozenset[int]:
    folder = Path(get_data_path()) / "fonts" / "ttf"
    of_each = [frozenset(FT2Font(str(folder / file)).get_charmap()) for file in FILES]
    return frozenset.intersection(*of_each)


def printable(text: str) -> str:
    """Return text on one line, with a white square for every character that the font lacks."""
    shown = " ".join(text.split())
    return "".join(c if ord(c) in _characters() else "\N{WHITE SQUARE}" for c in shown)
