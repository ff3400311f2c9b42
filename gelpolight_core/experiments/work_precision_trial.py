"""Error against run time of one calibration, as it is, on presses whose truth is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.errors import InputError
from gelpolight_core.experiments.methods import Method, methods
from gelpolight_core.experiments.work_precision import (
    CALIBRATING,
    LEAST_REPEATS,
    Point,
    measure_scene,
    scene_of,
)
from gelpolight_core.measurement.truth import read_truth
from gelpolight_core.session.session import read_session
from gelpolight_core.simulation.session import simulate_session
from gelpolight_core.translation import tr

Progress = Callable[[str, float], None]
FLAT_TOPPED = ("cylinder", "cuboid")
USUAL = ("paper", "full_fast", "full_balanced", "full_best")
"""What a person chooses between."""


def chosen_methods(everything: bool) -> tuple[Method, ...]:
    """Return the methods that one calibration suffices for, or only those of `USUAL`."""
    needs_stages = ("directional",)
    return tuple(
        method
        for method in methods()
        if method.name in USUAL or (everything and method.name not in needs_stages)
    )


def measure_calibration(
    calibration: Calibration,
    folder: Path,
    chosen: Sequence[Method],
    *,
    repeats: int = LEAST_REPEATS,
    progress: Progress | None = None,
) -> tuple[Point, ...]:
    """Measure methods with a calibration on the presses of a session folder with truth.

    Parameters
    ----------
    calibration : Calibration
        Of the sensor that the session is of.
    folder : Path
        With ``presses/truth.csv`` and ``truth/*.npz``; cylinders and cuboids count.
    chosen : sequence of Method
        From :func:`chosen_methods`.
    repeats : int, optional
        Timed rounds.
    progress : callable, optional
        Told what is being done and the share done; what it raises stops the work.

    Raises
    ------
    InputError
        If the session is of another sensor, or its presses have no picture or no truth.
    """
    session = read_session(folder)
    _refuse_other(session.sensor.serial, calibration, str(folder))
    rows = read_truth(folder / "presses" / "truth.csv").rows
    flat = [row.file for row in rows if row.truth.shape in FLAT_TOPPED]
    return measure_scene(
        scene_of(calibration),
        replace(session, response=calibration.response),
        chosen,
        repeats=repeats,
        presses=flat,
        progress=progress,
    )


def measure_virtual(
    calibration: Calibration,
    design: SensorDesign,
    chosen: Sequence[Method],
    *,
    repeats: int = LEAST_REPEATS,
    progress: Progress | None = None,
) -> tuple[Point, ...]:
    """Measure methods with a calibration of the virtual sensor, on presses that are rendered now.

    Parameters
    ----------
    calibration : Calibration
        Of that design, at any picture size.
    design : SensorDesign
        Its cylinders and cuboids are pressed.
    chosen, repeats, progress
        As for :func:`measure_calibration`.

    Raises
    ------
    InputError
        If the calibration is of another sensor.
    """
    _refuse_other(design.serial, calibration, tr("virtual sensor"))
    tell = progress or (lambda _what, _share: None)
    flat = tuple(p for p in design.presses if p.shape in FLAT_TOPPED)
    scale = calibration.camera.width / design.camera.width_px
    with TemporaryDirectory(prefix="gelpolight-") as temporary:
        folder = Path(temporary) / design.serial
        simulate_session(
            replace(design, presses=flat),
            folder,
            scale=scale,
            presses_only=True,
            progress=partial(_rendered, tell),
        )
        return measure_calibration(calibration, folder, chosen, repeats=repeats, progress=progress)


def _refuse_other(serial: str, calibration: Calibration, where: str) -> None:
    if serial != calibration.sensor.serial:
        raise InputError(
            tr("the presses are of {one}, the calibration is of {other}").format(
                one=serial, other=calibration.sensor.serial
            ),
            where=where,
            advice=tr("Choose presses of this sensor that have a truth, or its own calibration"),
        )


def _rendered(tell: Progress, file: str, share: float) -> None:
    tell(tr("rendering {file}").format(file=file), CALIBRATING * share)
