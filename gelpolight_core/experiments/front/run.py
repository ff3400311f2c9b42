"""Error against run time of several sensors at several image sizes, from one seed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.design_check.known_sensor import matt_design
from gelpolight_core.experiments.front.measure import REPEATS, Point, measure_scene
from gelpolight_core.experiments.front.methods import Method
from gelpolight_core.experiments.front.scene import (
    FLAT_TOPPED,
    Map,
    Press,
    Scene,
    at_scale,
    calibrated_scene,
    session_presses,
    smaller,
)
from gelpolight_core.experiments.leave_out import (
    EMPTY,
    PRESSED,
    SHALLOW,
    Frame,
    RuleFigure,
    measure_rules,
)
from gelpolight_core.measurement.truth import read_truth
from gelpolight_core.session.session import Session, read_session
from gelpolight_core.simulation.indenters import Cylinder
from gelpolight_core.simulation.plan import AVERAGED
from gelpolight_core.simulation.session import pressed_membrane, simulate_session
from gelpolight_core.simulation.virtual_sensor import BareMembrane, VirtualSensor

Progress = Callable[[str, float], None]
WIDTHS = (320, 640, 1280, 2560)
SHALLOW_MM = 0.03
MOST_FRAMES = 4
"""Presses for the rules: each is solved a dozen times."""
PREPARING = 0.4
"""Share of calibration and rendering in the work for a sensor, for the progress."""


@dataclass(frozen=True, slots=True)
class Source:
    """Source of a sensor's images.

    Attributes
    ----------
    name : str
        Of the sensor.
    folder : Path
        Its session. That of a virtual sensor is simulated if it does not exist yet.
    kept : Path
        Folder for its calibrations and larger images; results of an earlier run are used again.
    design : SensorDesign or None
        Of a virtual sensor.
    """

    name: str
    folder: Path
    kept: Path
    design: SensorDesign | None = None


def sources(sessions: Sequence[Path], out: Path, *, virtual: bool = True) -> tuple[Source, ...]:
    """Return the sensors of some sessions, and two virtual ones.

    Parameters
    ----------
    sessions : sequence of Path
        Session folders with true depths.
    out : Path
        Folder of the report.
    virtual : bool, optional
        Whether to add the default virtual sensor, glossy with crosstalk, and a matt one without.

    Raises
    ------
    InputError
        If a folder is not a session with presses of known size.
    """
    found = []
    for folder in sessions:
        read_session(folder)
        read_truth(folder / "presses" / "truth.csv")
        name = folder.resolve().name
        found.append(Source(name, folder, out / name))
    designs = {
        "virtual-glossy": SensorDesign(),
        "virtual-matt": replace(matt_design(1.0), serial="virtual-matt"),
    }
    for name, design in designs.items() if virtual else ():
        flat = tuple(p for p in design.presses if p.shape in FLAT_TOPPED)
        design = replace(design, presses=flat)
        found.append(Source(name, out / name / "session", out / name, design))
    return tuple(found)


def measure_sensor(
    source: Source,
    methods: Sequence[Method],
    *,
    widths: Sequence[int] = WIDTHS,
    repeats: int = REPEATS,
    presses: Sequence[str] = (),
    seed: int = 0,
    progress: Progress | None = None,
) -> tuple[Point, ...]:
    """Calibrate a sensor once, and measure every method at every possible image size.

    Parameters
    ----------
    source : Source
        The sensor.
    methods : sequence of Method
        From :func:`~gelpolight_core.experiments.front.methods.methods`.
    widths : sequence of int, optional
        Of the images, in pixels. Smaller ones are averages of the session's; larger ones are
        rendered for a virtual sensor, and left out for others.
    repeats : int, optional
        How often each press is timed.
    presses : sequence of str, optional
        Only these files.
    seed : int, optional
        Of a virtual sensor.
    progress : callable, optional
        Called with the present task and the share done; its exceptions stop the work.

    Raises
    ------
    InputError
        If the session cannot be calibrated, or a press has no image or no truth.
    """
    progress = progress or (lambda _what, _share: None)
    session, scene = prepared(source, seed, partial(_part, progress, source.name, 0.0, PREPARING))
    points: list[Point] = []
    chosen = [width for width in widths if _scale(width, scene, source) is not None]
    for number, width in enumerate(chosen):
        begin = PREPARING + (1.0 - PREPARING) * number / len(chosen)
        within = partial(_part, progress, source.name, begin, (1.0 - PREPARING) / len(chosen))
        scale = _scale(width, scene, source)
        assert scale is not None
        sized, shown = _at_size(source, session, scene, scale, presses, seed)
        points += measure_scene(sized, shown, methods, repeats=repeats, progress=within)
    return tuple(points)


def prepared(source: Source, seed: int, progress: Progress) -> tuple[Session, Scene]:
    """Return a sensor's session and calibration; results of an earlier run are used again.

    Parameters
    ----------
    source : Source
        The sensor.
    seed : int
        Of a virtual sensor.
    progress : callable
        Called with the present task and the share done.
    """
    folder = source.folder
    if source.design is not None and not (folder / "truth.json").is_file():
        simulate_session(
            source.design, folder, seed=seed, progress=partial(_part, progress, "", 0, 0.6)
        )
    session = read_session(folder)
    scene = calibrated_scene(session, source.kept, partial(_part, progress, "", 0.6, 0.4))
    return replace(session, response=scene.full.response), replace(scene, sensor=source.name)


def measure_leaving_out(
    source: Source, *, seed: int = 0, repeats: int = REPEATS, progress: Progress | None = None
) -> tuple[RuleFigure, ...]:
    """Measure the saved time and the change of depth of each rule, at the session's size.

    Parameters
    ----------
    source : Source
        The sensor.
    seed : int, optional
        Of a virtual sensor.
    repeats : int, optional
        How often each frame is timed.
    progress : callable, optional
        Called with the present task and the share done; its exceptions stop the work.

    Raises
    ------
    InputError
        If the session cannot be calibrated, or a press has no image.
    """
    progress = progress or (lambda _what, _share: None)
    session, scene = prepared(source, seed, partial(_part, progress, source.name, 0.0, 0.2))
    frames = [Frame(PRESSED, press.frame) for press in session_presses(session)[:MOST_FRAMES]]
    bare = session.averaged("background").rgb
    frames.append(Frame(EMPTY, np.rint(255.0 * bare).astype(np.uint8)))
    if source.design is not None:
        surface = pressed_membrane(source.design, Cylinder(5.0, SHALLOW_MM), x_mm=1.0, y_mm=-1.0)
        seen = VirtualSensor(source.design, seed).frame(surface, stream="presses/shallow.png")
        frames.append(Frame(SHALLOW, seen))
    within = partial(_part, progress, source.name, 0.2, 0.8)
    return measure_rules(source.name, scene.full, frames, repeats=repeats, progress=within)


def render_larger(source: Source, scale: int, seed: int) -> Path:
    """Render a virtual sensor's presses with a larger camera, unless an earlier run did."""
    assert source.design is not None
    width = round(source.design.camera.width_px * scale)
    folder = source.kept / f"presses-{width}"
    if not (folder / "truth.json").is_file():
        simulate_session(source.design, folder, seed=seed, scale=scale, presses_only=True)
    return folder


def _scale(width: int, scene: Scene, source: Source) -> float | None:
    """Return a size over that of the session; None if its images do not allow it."""
    own = scene.full.camera.width
    if own % width == 0:
        return width / own
    return width / own if width % own == 0 and source.design is not None else None


def _at_size(
    source: Source,
    session: Session,
    scene: Scene,
    scale: float,
    names: Sequence[str],
    seed: int,
) -> tuple[Scene, list[Press]]:
    """Return the sensor and its presses at another size."""
    if scale > 1.0:
        assert source.design is not None
        larger = read_session(render_larger(source, round(scale), seed))
        camera = VirtualSensor(source.design.scaled(scale), seed)
        averaged = AVERAGED["background"]
        bare = camera.frame(BareMembrane(), averaged=averaged, stream="background/background.png")
        light: Map = bare.astype(np.float32) / np.float32(np.iinfo(bare.dtype).max)
        return at_scale(scene, scale, light), session_presses(larger, names)
    shown = session_presses(session, names)
    if scale == 1.0:
        return scene, shown
    factor = round(1.0 / scale)
    light = smaller(session.averaged("background").rgb, factor)
    return at_scale(scene, scale, light), [
        replace(press, frame=smaller(press.frame, factor)) for press in shown
    ]


def _part(
    progress: Progress, name: str, begin: float, width: float, what: str, share: float
) -> None:
    progress(f"{name}: {what}" if name and what else name or what, begin + width * share)
