"""Shared parts of the commands: progress, tables and tolerances."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from math import inf

from app.command_line.options import option
from app.command_line.terminal import harmless
from app.services.kept import kept_in_file
from app.services.preferences import Limits
from gelpolight_core.causes import with_one_cause
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.finding import QualityTable, Verdict

tolerance = partial(
    option,
    "tolerances of size and height in percent (default: those of the preferences)",
    metavar=("SIZE", "HEIGHT"),
)


def tolerances(percent: tuple[float, float] | None) -> tuple[float, float]:
    """Return the tolerances of size and height in percent, by default from the preferences.

    Raises
    ------
    InputError
        If one is not a positive number.
    """
    size, height = percent or kept_in_file(Limits, "limits").percent
    if not (0.0 < size < inf and 0.0 < height < inf):
        raise InputError("A tolerance is not greater than 0", "--tolerance", Remedy.CORRECT_VALUE)
    return size, height


@contextmanager
def stage_progress() -> Iterator[Callable[[str, float], None]]:
    """Show a progress bar on stderr. Yield the function that reports a stage with its progress."""
    from tqdm import tqdm  # slow to import

    with tqdm(total=100, file=sys.stderr, bar_format="{desc:<24}{bar:30}{n:4.0f} %") as bar:

        def report(stage: str, share: float) -> None:
            bar.set_description_str(stage)
            bar.n = round(100 * share)
            bar.refresh()

        yield report


def quality_lines(tables: Mapping[str, QualityTable]) -> list[str]:
    """Return the quality tables of all stages as lines of text."""
    cause, tables = with_one_cause(tables)
    lines = [f"{cause}."] if cause else []
    for stage, table in tables.items():
        lines.append(f"{harmless(stage)}: {table.verdict.value}")
        for figure in table.figures:
            mark = {Verdict.PASS: " ", Verdict.WARN: "!", Verdict.FAIL: "X"}[figure.verdict]
            limit = "" if figure.warn_limit is None else f"limit {figure.warn_limit:g}"
            value = f"{figure.value:>10.4g} {harmless(figure.unit):<4}"
            lines.append(f"  {mark} {harmless(figure.text):<58} {value} {limit}".rstrip())
            if figure.verdict is not Verdict.PASS and figure.remedy:
                lines.append(f"      {harmless(figure.remedy)}.")
    return lines
