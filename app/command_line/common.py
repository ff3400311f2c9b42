"""Functions that several commands share: arguments, progress and tables."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from tqdm import tqdm

from app.command_line.terminal import harmless
from gelpolight_core.causes import with_one_cause
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.finding import QualityTable, Verdict
from gelpolight_core.io.atomic import refuse_unwritable
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


def numbers(text: str) -> list[float]:
    """Return the numbers of an argument such as ``1.5`` or ``1.5,-2``."""
    return [float(part) for part in text.split(",")]


def points(given: Iterable[Iterable[float]], *, where: str) -> list[tuple[float, float]]:
    """Return points from numbers X Y X Y ..., separated by spaces or commas.

    Raises
    ------
    InputError
        If their count is odd.
    """
    flat = [value for part in given for value in part]
    if len(flat) % 2 or not flat:
        raise InputError(
            tr("Number of values: {n}, but each point needs two").format(n=len(flat)),
            where=where,
            advice=Remedy.CORRECT_VALUE,
        )
    return list(zip(flat[::2], flat[1::2], strict=True))


def one_point(given: Iterable[Iterable[float]], *, where: str) -> tuple[float, float]:
    """Return one point from numbers X Y, see :func:`points`."""
    found = points(given, where=where)
    if len(found) != 1:
        raise InputError(
            tr("Number of points: {n} instead of one").format(n=len(found)),
            where=where,
            advice=Remedy.CORRECT_VALUE,
        )
    return found[0]


def refuse_overwriting(outputs: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Raise an error if a result would overwrite an input or another result."""
    used = {path.resolve() for path in inputs}
    for path in outputs:
        result = path.resolve()
        if result in used:
            raise InputError(
                tr("The result would overwrite a file that is used here"),
                where=path,
                advice=Remedy.CHOOSE_NAME,
            )
        used.add(result)


def check_outputs(outputs: Iterable[Path | None], inputs: Iterable[Path | None]) -> None:
    """Raise an error if a result would overwrite a file that is used, or cannot be written.

    None is a file that is not requested.
    """
    results = [path for path in outputs if path is not None]
    refuse_overwriting(results, [path for path in inputs if path is not None])
    for path in results:
        refuse_unwritable(path)


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
