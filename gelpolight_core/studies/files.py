"""The result files of a study: its table as CSV, and one figure as PNG."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gelpolight_core.drawing_thread import in_drawing_thread
from gelpolight_core.io.atomic import write_atomically, write_text
from gelpolight_core.io.table import csv_text

DPI = 150


def write_table(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write a table as CSV.

    Parameters
    ----------
    rows : sequence of mapping
        All with the same keys, which are the columns; None is an empty cell.
    path : Path
        The file.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    write_text(path, csv_text(list(rows[0]), (row.values() for row in rows)))


def write_results(
    folder: Path, name: str, rows: Sequence[Mapping[str, Any]], figure_png: bytes
) -> list[Path]:
    """Write ``NAME.csv`` and ``NAME.png``, from :func:`drawn`, into a folder; return their paths.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    table, image = folder / f"{name}.csv", folder / f"{name}.png"
    write_table(rows, table)
    write_atomically(image, lambda out: out.write(figure_png))
    return [table, image]


@in_drawing_thread
def drawn(paint: Callable[[Figure], None], width_in: float, height_in: float) -> bytes:
    """Return what `paint` draws on an empty figure of the given size, as PNG."""
    stream = io.BytesIO()
    with rc_context({"axes.formatter.min_exponent": 4}):  # writes 10 and 0.1 instead of powers
        figure = Figure(figsize=(width_in, height_in), layout="constrained")
        FigureCanvasAgg(figure)
        paint(figure)
        figure.savefig(stream, format="png", dpi=DPI)
    return stream.getvalue()
