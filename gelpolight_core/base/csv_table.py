"""Tables as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from .errors import InputError, Remedy
from .safe_reading import TEXT_LIMIT, read_file, short_repr


def csv_text(columns: Sequence[str], rows: Iterable[Iterable[object]], comma: bool = False) -> str:
    """Return a table as CSV with a line of column names, None as an empty cell.

    With a decimal comma, semicolons separate the cells.
    """
    text, (decimal, separator) = io.StringIO(), (",", ";") if comma else (".", ",")
    writer = csv.writer(text, delimiter=separator, lineterminator="\n")
    for row in (columns, *rows):
        writer.writerow(str(x).replace(".", decimal) if isinstance(x, float) else x for x in row)
    return text.getvalue()


def csv_from_dicts(rows: Sequence[Mapping[str, object]]) -> str:
    """Return rows that have the same keys, which are the columns, as CSV."""
    return csv_text(list(rows[0]), (row.values() for row in rows))


def read_csv(path: Path, limit: int = TEXT_LIMIT) -> list[tuple[int, list[str]]]:
    """Return the lines of a CSV file that are not empty, each with its number.

    Cells are separated by commas; by semicolons if the first line has some and no comma, as in
    tables of spreadsheets that write decimals with a comma.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    InputError
        If it is not a table in UTF-8, is larger than `limit` bytes, or a line has more cells than
        the first one.
    """
    try:
        text = read_file(path, limit).decode("utf-8-sig")
        if "\0" in text:  # no name of a file contains it
            raise csv.Error("line contains NUL")
        lines = text.splitlines()
        first = next(filter(str.strip, lines), "")
        sign = ";" if ";" in first and "," not in first else ","
        reader = csv.reader(lines, delimiter=sign, skipinitialspace=True)
        rows = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except (UnicodeDecodeError, csv.Error) as error:
        text = f"the file is not a table ({short_repr(str(error), 200)})"
        raise InputError(text, path, Remedy.SAVE_CSV) from error
    columns = len(rows[0][1]) if rows else 0
    for line, row in rows:
        if any(cell.strip() for cell in row[columns:]):
            text = f"the line has {len(row)} cells, the table has {columns} columns"
            raise InputError(text, f"{path}, line {line}", Remedy.WRITE_POINT)
    return rows
