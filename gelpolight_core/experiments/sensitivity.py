"""Effect of an error of each calibration parameter on the depth, for the tornado chart.

One parameter at a time is changed. The images remain unchanged, and everything that the calibration
derives from them (background, light) is computed again. A fit of several parameters on ball presses
would compensate part of the error; here there is no such fit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.design_check.known_sensor import KnownPress, KnownSensor, exact_calibration
from gelpolight_core.experiments.stability_trial import rms_um
from gelpolight_core.measurement.score import score_depth
from gelpolight_core.optics.frame import TopPlane
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.simulation.indenters import Cylinder
from gelpolight_core.translation import tr

Progress = Callable[[str, float], None]
Change = Callable[[KnownSensor, float], Calibration]
HEIGHT_MM = 1.0
PRESS = Cylinder(5.0, HEIGHT_MM)
PRESS_AT_MM = (1.5, -1.0)


@dataclass(frozen=True, slots=True)
class Parameter:
    """A calibration parameter with an error.

    Attributes
    ----------
    name, label, unit : str
        For files, for people, and what it is counted in.
    sd : float
        Its standard uncertainty, from its stage or a data sheet.
    source : str
        Source of the uncertainty.
    change : callable
        Returns a sensor's calibration with the parameter changed by a number of its unit.
    """

    name: str
    label: str
    unit: str
    sd: float
    source: str
    change: Change

    @property
    def stated(self) -> str:
        """The standard uncertainty with its unit."""
        return f"{self.sd:g} {self.unit}".rstrip()


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """Effect of one parameter.

    Attributes
    ----------
    parameter : Parameter
        The changed parameter.
    low_percent, high_percent : float
        Change of the plateau's height with the parameter one standard uncertainty low, and high.
    rms_um : float
        Root mean square change of the depth, the larger of both.
    unit_percent : float
        Change of the height for one unit of the parameter, from the same two.
    """

    parameter: Parameter
    low_percent: float
    high_percent: float
    rms_um: float
    unit_percent: float

    @property
    def swing_percent(self) -> float:
        """The larger of the two changes, without its sign."""
        return max(abs(self.low_percent), abs(self.high_percent))


def parameters() -> tuple[Parameter, ...]:
    """Return the parameters with the uncertainties of a careful calibration."""
    mirror, sheet = tr("mirror, refined on balls"), tr("data sheet")
    pose, lens = tr("top pose"), tr("checkerboard")
    leds = [
        Parameter(
            f"led_{name}_{axis}",
            tr("LED {name}, {axis}").format(name=name, axis=axis),
            "mm",
            0.1,
            mirror,
            partial(_led, k, i),
        )
        for k, name in enumerate(("red", "green", "blue"))
        for i, axis in enumerate("xyz")
    ]
    return (
        *leds,
        Parameter("leds_z", tr("all LEDs, z"), "mm", 0.2, tr("housing"), _leds_z),
        Parameter("thickness", tr("elastomer thickness"), "mm", 0.1, tr("gauge"), _thickness),
        Parameter("index", tr("elastomer index"), "", 0.005, sheet, _index),
        Parameter("distance", tr("top surface, distance"), "mm", 0.02, pose, _distance),
        Parameter("tilt_x", tr("top surface, tilt about y"), "deg", 0.06, pose, partial(_tilt, 0)),
        Parameter("tilt_y", tr("top surface, tilt about x"), "deg", 0.06, pose, partial(_tilt, 1)),
        Parameter("focal", tr("focal length"), "%", 0.1, lens, _focal),
        Parameter("centre_x", tr("principal point, x"), "% f", 0.05, lens, partial(_centre, "cx")),
        Parameter("centre_y", tr("principal point, y"), "% f", 0.05, lens, partial(_centre, "cy")),
        Parameter("k1", tr("distortion k1"), "", 0.002, lens, _distortion),
        Parameter(
            "exponent", tr("reflectance, exponent of the cosine"), "%", 1.0, tr("balls"), _exponent
        ),
        Parameter("gloss", tr("reflectance, glossy share"), "%", 1.0, tr("balls"), _gloss),
        Parameter("factors", tr("background, all channels"), "%", 1.0, tr("lamps"), _light),
        Parameter("factor_red", tr("background, red channel"), "%", 1.0, tr("lamps"), _red_light),
        Parameter("crosstalk", tr("crosstalk, each channel"), "%", 0.5, tr("mirror"), _crosstalk),
    )


def sensitivities(
    known: KnownSensor,
    *,
    chosen: Sequence[Parameter] | None = None,
    progress: Progress | None = None,
) -> tuple[Sensitivity, ...]:
    """Return the effect of each parameter on the depth of a cylinder of 1 mm, largest first.

    Parameters
    ----------
    known : KnownSensor
        A sensor with its exact calibration.
    chosen : sequence of Parameter, optional
        By default all of :func:`parameters`.
    progress : callable, optional
        Called with the parameter and the share done.
    """
    press = known.pressed(PRESS, x_mm=PRESS_AT_MM[0], y_mm=PRESS_AT_MM[1])
    exact, exact_height = _found(known.calibration, press)
    asked = parameters() if chosen is None else tuple(chosen)
    results = []
    for number, parameter in enumerate(asked):
        if progress is not None:
            progress(parameter.label, number / len(asked))
        changes, rms = [], []
        for sign in (-1.0, 1.0):
            depth, height = _found(parameter.change(known, sign * parameter.sd), press)
            changes.append(height - exact_height)
            rms.append(rms_um((_common(depth, exact)).astype(np.float64)))
        slope = (changes[1] - changes[0]) / (2.0 * parameter.sd)
        results.append(Sensitivity(parameter, changes[0], changes[1], max(rms), slope))
    if progress is not None:
        progress("", 1.0)
    return tuple(sorted(results, key=lambda s: -s.swing_percent))


def _common(depth: NDArray[np.float32], exact: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the difference on the common part of both grids."""
    rows, columns = np.minimum(depth.shape, exact.shape)
    difference: NDArray[np.float32] = depth[:rows, :columns] - exact[:rows, :columns]
    return difference


def _found(calibration: Calibration, press: KnownPress) -> tuple[NDArray[np.float32], float]:
    """Return depth and height error in per cent."""
    found = Reconstructor(calibration).depth(press.frame, normals=False)
    radius = 0.5 * calibration.sensor.working_diameter_mm - 1.0
    score = score_depth(
        found.depth_mm, found.x_mm, found.y_mm, press.truth, height_mm=HEIGHT_MM, radius_mm=radius
    )
    return found.depth_mm, score.height_percent


def _led(k: int, axis: int, known: KnownSensor, by: float) -> Calibration:
    leds = known.calibration.led_positions_mm.copy()
    leds[k, axis] += by
    return exact_calibration(known.sensor, leds_mm=leds)


def _leds_z(known: KnownSensor, by: float) -> Calibration:
    leds = known.calibration.led_positions_mm + np.array([0.0, 0.0, by])
    return exact_calibration(known.sensor, leds_mm=leds)


def _thickness(known: KnownSensor, by: float) -> Calibration:
    stated = known.calibration.sensor
    thicker = replace(stated, elastomer_thickness_mm=stated.elastomer_thickness_mm + by)
    return exact_calibration(known.sensor, stated=thicker)


def _index(known: KnownSensor, by: float) -> Calibration:
    stated = known.calibration.sensor
    index = stated.elastomer_refractive_index + by
    return exact_calibration(known.sensor, stated=replace(stated, elastomer_refractive_index=index))


def _distance(known: KnownSensor, by: float) -> Calibration:
    plane = known.calibration.plane
    moved = TopPlane(plane.normal_camera, plane.distance_mm + by)
    return exact_calibration(known.sensor, plane=moved)


def _tilt(axis: int, known: KnownSensor, by: float) -> Calibration:
    plane = known.calibration.plane
    normal = np.array(plane.normal_camera)
    normal[axis] += np.radians(by)
    normal /= np.linalg.norm(normal)
    x, y, z = normal.tolist()
    return exact_calibration(known.sensor, plane=TopPlane((x, y, z), plane.distance_mm))


def _focal(known: KnownSensor, by: float) -> Calibration:
    camera, factor = known.calibration.camera, 1.0 + 0.01 * by
    longer = replace(camera, fx=camera.fx * factor, fy=camera.fy * factor)
    return exact_calibration(known.sensor, camera=longer)


def _centre(name: str, known: KnownSensor, by: float) -> Calibration:
    camera = known.calibration.camera
    moved = getattr(camera, name) + 0.01 * by * camera.fx
    return exact_calibration(known.sensor, camera=replace(camera, **{name: moved}))


def _distortion(known: KnownSensor, by: float) -> Calibration:
    camera = known.calibration.camera
    k1, *others = camera.distortion
    bent = (k1 + by, others[0], others[1], others[2], others[3])
    return exact_calibration(known.sensor, camera=replace(camera, distortion=bent))


def _exponent(known: KnownSensor, by: float) -> Calibration:
    full = known.calibration.full
    assert full is not None
    membrane = replace(full.membrane, exponent=full.membrane.exponent * (1.0 + 0.01 * by))
    return replace(known.calibration, full=replace(full, membrane=membrane))


def _gloss(known: KnownSensor, by: float) -> Calibration:
    full = known.calibration.full
    assert full is not None
    # A negative share is impossible: low is the effect of high with the opposite sign.
    membrane = replace(full.membrane, gloss=max(full.membrane.gloss + 0.01 * by, 0.0))
    return replace(known.calibration, full=replace(full, membrane=membrane))


def _light(known: KnownSensor, by: float) -> Calibration:
    return _background(known, np.full(3, 1.0 + 0.01 * by, np.float32))


def _red_light(known: KnownSensor, by: float) -> Calibration:
    return _background(known, np.array([1.0 + 0.01 * by, 1.0, 1.0], np.float32))


def _background(known: KnownSensor, factor: NDArray[np.float32]) -> Calibration:
    full = known.calibration.full
    assert full is not None
    return replace(known.calibration, full=replace(full, background=full.background * factor))


def _crosstalk(known: KnownSensor, by: float) -> Calibration:
    mixed = known.calibration.crosstalk + 0.01 * by * (1.0 - np.eye(3))
    return exact_calibration(known.sensor, crosstalk=mixed)
