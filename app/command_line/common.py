"""What several commands share: arguments, progress and tables."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from app.command_line.terminal import harmless
from gelpolight_core.calibration.calibration import MODELS
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.calibration.pipeline import STAGES
from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import write_atomically
from gelpolight_core.quality import QualityTable, Verdict
from gelpolight_core.reconstruction.plan import EFFORTS, Plan
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.decisions import FILE_NAME as DECISIONS
from gelpolight_core.session.description import FILE_NAME as DESCRIPTION
from gelpolight_core.session.session import Session, read_picture, require_colour
from gelpolight_core.translation import tr


class StageProgress:
    """A progress bar on stderr that a stage function can tell its name and share to."""

    def __init__(self) -> None:
        self._bar = tqdm(total=100, file=sys.stderr, bar_format="{desc:<24}{bar:30}{n:4.0f} %")

    def __enter__(self) -> Callable[[str, float], None]:
        """Return the function to be told."""
        return self._tell

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the bar."""
        self._bar.close()

    def _tell(self, stage: str, share: float) -> None:
        self._bar.set_description_str(stage)
        self._bar.n = round(100 * share)
        self._bar.refresh()


def add_model(parser: argparse.ArgumentParser, *, default: str | None = None) -> None:
    """Add ``--model``; without a default, a calibration's own model is used."""
    parser.add_argument(
        "--model",
        choices=MODELS,
        default=default,
        help=tr(
            "paper: lights frozen at the flat membrane, straight integration; full: near light, "
            "gloss, light from the surroundings, shadows, along the rays (the default)"
        ),
    )


def add_effort(parser: argparse.ArgumentParser) -> None:
    """Add ``--effort``."""
    parser.add_argument(
        "--effort",
        choices=EFFORTS,
        default=EFFORTS[-1],
        help=tr(
            "how much work the full model's picture is worth: best solves the whole field at full "
            "scale (the default); balanced does what the picture needs, at half scale; fast at "
            "quarter scale"
        ),
    )


def add_workers(parser: argparse.ArgumentParser, *, default: int) -> None:
    """Add ``--workers``: how many pictures are worked on at a time."""
    parser.add_argument(
        "--workers",
        type=int,
        choices=range(1, 65),
        default=default,
        metavar="N",
        help=tr("pictures that are worked on at a time, each by a process ({n})").format(n=default),
    )


def load_reconstructor(
    path: Path, *, model: str | None = None, effort: str = EFFORTS[-1]
) -> Reconstructor:
    """Read a calibration and make its reconstructor ready, for its own model or another."""
    return Reconstructor(read_calibration(path), model=model, effort=effort)


def read_frame(path: Path, reconstructor: Reconstructor) -> NDArray[np.float32]:
    """Read a colour picture as linear light, for a reconstructor's camera."""
    picture = read_picture(path, response=reconstructor.calibration.response)
    require_colour(picture, where=str(path))
    return picture.rgb


def numbers(text: str) -> list[float]:
    """Return the numbers of an argument such as ``1.5`` or ``1.5,-2``."""
    return [float(part) for part in text.split(",")]


def points(given: Iterable[Iterable[float]], *, where: str) -> list[tuple[float, float]]:
    """Return places from numbers X Y X Y ..., separated by spaces or commas.

    Raises
    ------
    InputError
        If their count is odd.
    """
    flat = [value for part in given for value in part]
    if len(flat) % 2 or not flat:
        raise InputError(
            tr("{n} numbers, where each place has two").format(n=len(flat)),
            where=where,
            advice=tr("Give X and Y in mm for each place"),
        )
    return list(zip(flat[::2], flat[1::2], strict=True))


def session_files(session: Session) -> tuple[Path, ...]:
    """Return what no result may take the place of: all that was captured, stated and decided."""
    stages = (*session.optional_stages, *STAGES)
    pictures = (path for stage in stages for path in session.captured(stage))
    return (session.folder / DESCRIPTION, session.folder / DECISIONS, *pictures)


def refuse_overwriting(outputs: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Refuse to write over a file that is read, or twice to the same one."""
    taken = {path.resolve() for path in inputs}
    for path in outputs:
        place = path.resolve()
        if place in taken:
            raise InputError(
                tr("the result would take the place of a file that is used here"),
                where=str(path),
                advice=tr("Choose another name or folder for the result"),
            )
        taken.add(place)


def write_json(content: Mapping[str, Any], path: Path) -> None:
    """Write a JSON file, whole or not at all."""
    text = json.dumps(content, indent=1, allow_nan=False) + "\n"

    def write(stream: BinaryIO) -> None:
        stream.write(text.encode())

    write_atomically(path, write)


def plan_lines(plan: Plan) -> list[str]:
    """Return a frame's plan as lines of text."""
    lines = []
    for step in plan.steps:
        took = "" if step.milliseconds is None else f"{step.milliseconds:8.1f} ms"
        mark = tr("done") if step.done else tr("left out")
        lines.append(f"  {mark:<10}{step.name:<28}{took:<12} {step.reason}".rstrip())
    return lines


def quality_lines(tables: Mapping[str, QualityTable]) -> list[str]:
    """Return the quality tables of all stages as lines of text."""
    lines = []
    for stage, table in tables.items():
        lines.append(f"{harmless(stage)}: {table.verdict.value}")
        for figure in table.figures:
            mark = {Verdict.PASS: " ", Verdict.WARN: "!", Verdict.FAIL: "X"}[figure.verdict]
            limit = (
                "" if figure.warn_limit is None else tr("limit {x:g}").format(x=figure.warn_limit)
            )
            value = f"{figure.value:>10.4g} {harmless(figure.unit):<4}"
            lines.append(f"  {mark} {harmless(figure.label):<58} {value} {limit}".rstrip())
            if figure.verdict is not Verdict.PASS and figure.advice:
                lines.append(f"      {harmless(figure.advice)}.")
    return lines
