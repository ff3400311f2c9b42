"""Error against run time of one calibration, on presses with a known truth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.errors import InputError
from gelpolight_core.experiments.front.measure import REPEATS, Point, measure_scene
from gelpolight_core.experiments.front.methods import Method, methods
from gelpolight_core.experiments.front.scene import FLAT_TOPPED, Scene, session_presses
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.session import read_session
from gelpolight_core.simulation.session import simulate_session
from gelpolight_core.translation import tr

Progress = Callable[[str, float], None]
USUAL = ("paper", "full_fast", "full_balanced", "full_best")
"""The choices of the user."""
RENDERING = 0.4


def usual_methods() -> tuple[Method, ...]:
    """Return the methods of `USUAL`, for which one calibration is sufficient."""
    return tuple(method for method in methods() if method.name in USUAL)


def measure_calibration(
    calibration: Calibration,
    folder: Path,
    chosen: Sequence[Method],
    *,
    repeats: int = REPEATS,
    progress: Progress | None = None,
) -> tuple[Point, ...]:
    """Measure methods with a calibration on the presses of a session folder with truth.

    Parameters
    ----------
    calibration : Calibration
        Calibration of the session's sensor.
    folder : Path
        With ``presses/truth.csv`` and ``truth/*.npz``; cylinders and cuboids count.
    chosen : sequence of Method
        Such as :func:`usual_methods`.
    repeats : int, optional
        How often each press is timed.
    progress : callable, optional
        Called with the present task and the share done; its exceptions stop the work.

    Raises
    ------
    InputError
        If the session is of another sensor, or its presses have no image or no truth.
    """
    session = read_session(folder)
    _refuse_other(session.sensor.serial, calibration, str(folder))
    presses = session_presses(replace(session, response=calibration.response))
    scene = Scene(calibration.sensor.serial, calibration, calibration)
    return measure_scene(scene, presses, chosen, repeats=repeats, progress=progress)


def measure_virtual(
    calibration: Calibration,
    design: SensorDesign,
    chosen: Sequence[Method],
    *,
    repeats: int = REPEATS,
    progress: Progress | None = None,
) -> tuple[Point, ...]:
    """Measure methods with a calibration of the virtual sensor, on presses that are rendered now.

    Parameters
    ----------
    calibration : Calibration
        Of that design, at any image size.
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
    progress = progress or (lambda _what, _share: None)
    flat = tuple(p for p in design.presses if p.shape in FLAT_TOPPED)
    scale = calibration.camera.width / design.camera.width_px

    def measuring(what: str, share: float) -> None:
        progress(what, RENDERING + (1.0 - RENDERING) * share)

    with TemporaryDirectory(prefix="gelpolight-") as temporary:
        folder = Path(temporary) / design.serial
        simulate_session(
            replace(design, presses=flat),
            folder,
            scale=scale,
            presses_only=True,
            progress=partial(_rendered, progress),
        )
        return measure_calibration(calibration, folder, chosen, repeats=repeats, progress=measuring)


def _refuse_other(serial: str, calibration: Calibration, where: str) -> None:
    if serial != calibration.sensor.serial:
        raise InputError(
            tr("The presses are of {one}, the calibration is of {other}").format(
                one=serial, other=calibration.sensor.serial
            ),
            where=where,
            advice=tr(
                "Choose presses of this sensor with known true depth, or the calibration "
                "of their sensor"
            ),
        )


def _rendered(progress: Progress, file: str, share: float) -> None:
    progress(tr("rendering {file}").format(file=file), RENDERING * share)
