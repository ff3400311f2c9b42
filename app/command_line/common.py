"""Output that several commands share: progress and tables."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from tqdm import tqdm

from app.command_line.terminal import harmless
from gelpolight_core.causes import with_one_cause
from gelpolight_core.finding import QualityTable, Verdict
from gelpolight_core.translation import tr


@contextmanager
def stage_progress() -> Iterator[Callable[[str, float], None]]:
    """Show a progress bar on stderr. Yield the function that gets a stage and its progress."""
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
            limit = (
                "" if figure.warn_limit is None else tr("limit {x:g}").format(x=figure.warn_limit)
            )
            value = f"{figure.value:>10.4g} {harmless(figure.unit):<4}"
            lines.append(f"  {mark} {harmless(figure.text):<58} {value} {limit}".rstrip())
            if figure.verdict is not Verdict.PASS and figure.remedy:
                lines.append(f"      {harmless(figure.remedy)}.")
    return lines
