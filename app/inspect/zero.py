"""Zero (tare): the present background in the place of the calibration's, and whether it moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from app.workspace.workspace import ENDING, Workspace
from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.calibration.file import read_calibration, write_calibration
from gelpolight_core.quality import Verdict
from gelpolight_core.reconstruction.drift import BackgroundDrift, background_drift, zeroed
from gelpolight_core.translation import tr
from gelpolight_core.who import user_name

FRAMES = 8
SUFFIX = "-zero"


@dataclass(frozen=True, slots=True)
class Zeroed:
    """A calibration set to zero, and how far the background had moved before.

    Attributes
    ----------
    path : Path
        The calibration with the present background.
    origin : Path
        The calibration that it was made of, which is kept.
    before : BackgroundDrift
        The picture against that one.
    """

    path: Path
    origin: Path
    before: BackgroundDrift


def zero_calibration(workspace: Workspace, used: Path, frames: Sequence[NDArray[Any]]) -> Zeroed:
    """Write the calibration in use with the present background, and put that into use.

    It stands beside the one that it is made of, which stays as it is; zeroing again replaces it.

    Parameters
    ----------
    workspace : Workspace
        Keeps both.
    used : Path
        The calibration in use, which may itself be one set to zero.
    frames : sequence of (height, width, 3)
        Of the untouched sensor.

    Raises
    ------
    InputError
        If the sensor is touched or the frames cannot be used.
    """
    origin = original_of(used)
    calibration = read_calibration(origin)
    before = background_drift(frames[0], calibration)
    made = datetime.now(UTC).isoformat(timespec="seconds")
    changed = zeroed(calibration, frames, operator=user_name(), made=made)
    path = origin.with_name(f"{origin.stem}{SUFFIX}{ENDING}")
    write_calibration(changed, path)
    workspace.use(path)
    return Zeroed(path, origin, before)


def original_of(used: Path) -> Path:
    """Return the calibration that one set to zero was made of; another one is its own."""
    if used.stem.endswith(SUFFIX):
        origin = used.with_name(f"{used.stem.removesuffix(SUFFIX)}{ENDING}")
        if origin.is_file():
            return origin
    return used


def drift_sentence(frame: NDArray[Any], calibration: Calibration) -> str:
    """Return a warning where the untouched sensor has moved from its calibration; else nothing.

    With something pressed into the membrane nothing can be said.

    Raises
    ------
    InputError
        If the frame cannot be used.
    """
    drift = background_drift(frame, calibration)
    if drift.touched or drift.quality.verdict is Verdict.PASS:
        return ""
    worst = max(drift.quality.figures, key=lambda figure: _rank(figure.verdict))
    sentence = tr(
        "The background has moved from the calibration's ({what}: {v:.2g} {unit}). {advice}."
    )
    return sentence.format(
        what=worst.label[0].lower() + worst.label[1:],
        v=worst.value,
        unit=worst.unit,
        advice=worst.advice,
    )


def _rank(verdict: Verdict) -> int:
    return (Verdict.PASS, Verdict.WARN, Verdict.FAIL).index(verdict)
