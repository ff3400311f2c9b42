"""Tables as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence


def csv_text(columns: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    """Return a table as CSV, a line of column names first; None is an empty cell."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return text.getvalue()


def csv_of(rows: Sequence[Mapping[str, object]]) -> str:
    """Return rows that have the same keys, which are the columns, as CSV."""
    return csv_text(list(rows[0]), (row.values() for row in rows))
