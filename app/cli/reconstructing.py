"""Parts that the reconstructing commands share: arguments, the reconstructor, its trace."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.calibration.calibration_file import read_calibration
from gelpolight_core.output.formats import HEIGHT_MAP_FORMATS
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.trace import EFFORTS, Trace
from gelpolight_core.sensor.closed_sensor.closed_sensor_data import MODEL as IN_PLACE
from gelpolight_core.sensor.sensor_calibration import MODELS, Calibration
from gelpolight_core.session.session_images import read_colours

from .options import option
from .terminal import print_safe

model = partial(
    option,
    "paper: light of the flat membrane, direct integration; full: near "
    "light, gloss, interreflection, shadows, refracted rays; in-place: a "
    "closed sensor, from background and balls alone (default: the "
    "calibration's model)",
    choices=(*MODELS, IN_PLACE),
)
effort = partial(
    option,
    "effort of the full model, which solves the pressed region: best at full scale "
    "(default), balanced at half scale, fast at quarter scale",
    choices=EFFORTS,
    default=EFFORTS[-1],
)
despite_faults = partial(
    option,
    "also use images whose depth is meaningless, such as one of another sensor or with an "
    "LED off; by default they are refused",
)


def formats() -> Any:
    """Return the field of ``--format``, a list of some of the formats."""

    def listed(text: str) -> tuple[str, ...]:
        keys = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
        unknown = sorted(set(keys) - set(HEIGHT_MAP_FORMATS))
        if unknown or not keys:
            name, known = ", ".join(unknown) or '""', ", ".join(HEIGHT_MAP_FORMATS)
            raise InputError(
                f"Unknown format {name}", "--format", Remedy.ONE_OF.format(names=known)
            )
        return keys

    about = f"comma-separated list of {', '.join(HEIGHT_MAP_FORMATS)}"
    return option(about, type=listed, default="npz", metavar="LIST")


def load_reconstructor(
    path: Path, model: str | None = None, effort: str = EFFORTS[-1]
) -> Reconstructor:
    """Read a calibration and prepare its reconstructor, for its own model or another one."""
    calibration = read_calibration(path)
    report_failure(calibration, path)
    return Reconstructor(calibration, model=model, effort=effort)


def report_failure(calibration: Calibration, path: Path) -> None:
    """Warn of a calibration that failed."""
    if calibration.fault:
        fault = f"{path}: FAIL: {calibration.fault.text}. Everything measured with it is doubtful."
        print_safe(f"gelpolight: {fault}", file=sys.stderr)


def read_frame(path: Path, reconstructor: Reconstructor) -> NDArray[np.float32]:
    """Read a colour image as linear light, for a reconstructor's camera."""
    return read_colours(path, response=reconstructor.calibration.response).rgb


def trace_lines(trace: Trace) -> list[str]:
    """Return the trace of a frame as lines of text."""
    lines = []
    for step in trace.steps:
        took = "" if step.milliseconds is None else f"{step.milliseconds:8.1f} ms"
        mark = "done" if step.done else "left out"
        lines.append(f"  {mark:<10}{step.name:<28}{took:<12} {step.reason}".rstrip())
    return lines
