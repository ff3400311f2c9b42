"""Shared parts of the commands: progress, tables and tolerances."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from math import inf

from app.program.preferences import WarningLimits, read_settings_section
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import QualityTable, Verdict
from gelpolight_core.base.root_causes import cause_and_rest

from .options import option
from .terminal import escape_control

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
    size, height = percent or read_settings_section(WarningLimits, "limits").percent
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
    cause, tables = cause_and_rest(tables)
    lines = [f"{cause}."] if cause else []
    for stage, table in tables.items():
        lines.append(f"{escape_control(stage)}: {table.verdict.value}")
        for figure in table.figures:
            mark = {Verdict.PASS: " ", Verdict.WARN: "!", Verdict.FAIL: "X"}[figure.verdict]
            limit = "" if figure.warn_limit is None else f"limit {figure.warn_limit:g}"
            value = f"{figure.value:>10.4g} {escape_control(figure.unit):<4}"
            lines.append(f"  {mark} {escape_control(figure.text):<58} {value} {limit}".rstrip())
            if figure.verdict is not Verdict.PASS and figure.remedy:
                lines.append(f"      {escape_control(figure.remedy)}.")
    return lines
