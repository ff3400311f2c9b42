"""One object under point and under directional light, reconstructed by both methods.

The paper's Fig. 1 in numbers: how much of the membrane is in shadow, and how wrong the depth is, by
the near-light model and by the same model with its LEDs moved far away, which is the usual
assumption of directional light.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.design_check.known_sensor import KnownSensor, exact_calibration, matt
from gelpolight_core.errors import InputError
from gelpolight_core.measurement.score import TrueDepth, score_depth, scored_radius_mm
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.simulation.directional import directional_lamps, shadow_areas
from gelpolight_core.simulation.indenters import Cylinder, press
from gelpolight_core.simulation.lamps import Lamp, ParallelLamp, lamps_of
from gelpolight_core.simulation.surface import PressedSurface
from gelpolight_core.simulation.virtual_sensor import VirtualSensor
from gelpolight_core.translation import tr

Progress = Callable[[str, float], None]
FAR_MM = 1e4
WIDTH_PX = 320
TOUCHED_MM = 0.02
HEIGHT_SHARES = (0.6, 1.0, 1.5)
"""LED heights that are compared, over those of the design."""
ELEVATIONS_DEG = (15.0, 30.0, 45.0)


@dataclass(frozen=True, slots=True)
class LightingRow:
    """One kind of light.

    Attributes
    ----------
    lighting : str
        ``point`` or ``directional``.
    setting : float
        Mean LED height in mm, or elevation in degrees.
    shadow_percent : float
        Part of the pressed membrane that is dark under at least one light.
    unsolved_percent : float
        Part that is dark under two or three: its slope cannot be known.
    near_um, parallel_um : float or None
        Depth error, RMS, by the near-light model and by that of directional light; None where the
        method refuses the sensor.
    near_height_percent, parallel_height_percent : float or None
        Error of the plateau.
    """

    lighting: str
    setting: float
    shadow_percent: float
    unsolved_percent: float
    near_um: float | None
    parallel_um: float | None
    near_height_percent: float | None
    parallel_height_percent: float | None


def compare_lighting(
    design: SensorDesign,
    *,
    diameter_mm: float = 5.0,
    depth_mm: float = 1.0,
    position_mm: tuple[float, float] = (2.0, 1.0),
    height_shares: Sequence[float] = HEIGHT_SHARES,
    elevations_deg: Sequence[float] = ELEVATIONS_DEG,
    progress: Progress | None = None,
) -> tuple[LightingRow, ...]:
    """Press a cylinder under both kinds of light, and reconstruct it by both methods.

    The membrane is assumed matt, without crosstalk, and the calibration exact, so that only
    the light differs.

    Parameters
    ----------
    design : SensorDesign
        The sensor; its layers, camera and LEDs count.
    diameter_mm, depth_mm, position_mm : optional
        The cylinder, off the middle so that no symmetry helps.
    height_shares : sequence of float, optional
        LED heights over those of the design.
    elevations_deg : sequence of float, optional
        Of directional light above the top surface.
    progress : callable, optional
        Called with the present task and the share done; its exceptions stop the work.

    Raises
    ------
    InputError
        If the design does not hold together.
    """
    plain = matt(design).scaled(WIDTH_PX / design.camera.width_px)
    surface = press(
        Cylinder(diameter_mm, depth_mm),
        x_mm=position_mm[0],
        y_mm=position_mm[1],
        decay_mm=plain.membrane.decay_length_mm,
    )
    lights = [("point", share) for share in height_shares]
    lights += [("directional", elevation) for elevation in elevations_deg]
    rows = []
    for number, (kind, setting) in enumerate(lights):
        if progress is not None:
            name = tr("point light") if kind == "point" else tr("directional light")
            progress(name, number / len(lights))
        rows.append(_point_row(plain, surface, setting, depth_mm) if kind == "point"
                    else _directional_row(plain, surface, setting, depth_mm))  # fmt: skip
    return tuple(rows)


def lighting_lines(rows: Sequence[LightingRow]) -> list[str]:
    """Return the comparison as lines of text."""
    heads = (tr("shadow %"), tr("unsolved %"), tr("near um"), tr("parallel um"))
    lines = [
        tr("a pressed cylinder under both kinds of light, by both methods (depth error, RMS):"),
        f"{'':<26}" + "".join(f"{head:>13}" for head in heads),
    ]
    for row in rows:
        cells = (row.shadow_percent, row.unsolved_percent, row.near_um, row.parallel_um)
        texts = [tr("refused") if cell is None else f"{cell:.1f}" for cell in cells]
        lines.append(f"{lighting_name(row):<26}" + "".join(f"{text:>13}" for text in texts))
    return lines


def lighting_name(row: LightingRow) -> str:
    """Return what people call a kind of light."""
    if row.lighting == "point":
        return tr("point, LEDs at {h:.1f} mm").format(h=row.setting)
    return tr("directional, {angle:.0f} deg").format(angle=row.setting)


def _point_row(
    design: SensorDesign, surface: PressedSurface, share: float, depth_mm: float
) -> LightingRow:
    leds = tuple(replace(led, height_mm=share * led.height_mm) for led in design.leds)
    lit = replace(design, leds=leds)
    positions = np.array([[led.x_mm, led.y_mm, -led.height_mm] for led in leds])
    height = float(-positions[:, 2].mean())
    return _row(lit, lamps_of(lit), positions, surface, ("point", height), depth_mm)


def _directional_row(
    design: SensorDesign, surface: PressedSurface, elevation_deg: float, depth_mm: float
) -> LightingRow:
    lamps = directional_lamps(elevation_deg)
    heights = np.mean([led.height_mm for led in design.leds])
    towards = np.array([_direction(lamp) for lamp in lamps])
    # The near-light model has its LEDs in these directions, at the design's height.
    positions = towards * (heights / -towards[:, 2:])
    return _row(design, lamps, positions, surface, ("directional", elevation_deg), depth_mm)


def _direction(lamp: ParallelLamp) -> tuple[float, float, float]:
    azimuth, elevation = np.radians([lamp.azimuth_deg, lamp.elevation_deg])
    flat = float(np.cos(elevation))
    return flat * float(np.cos(azimuth)), flat * float(np.sin(azimuth)), -float(np.sin(elevation))


def _row(
    design: SensorDesign,
    lamps: tuple[Lamp, ...],
    leds_mm: NDArray[np.float64],
    surface: PressedSurface,
    light: tuple[str, float],
    depth_mm: float,
) -> LightingRow:
    sensor = VirtualSensor(design, lamps=lamps)
    far_mm = leds_mm * (FAR_MM / np.linalg.norm(leds_mm, axis=1, keepdims=True))
    _, any_dark, two_dark = shadow_areas(surface, lamps)
    pressed = float((surface.depth_mm > TOUCHED_MM).sum() * surface.pitch_mm**2)
    scores: list[tuple[float | None, float | None]] = []
    for positions in (leds_mm, far_mm):
        try:
            known = KnownSensor(sensor, exact_calibration(sensor, leds_mm=positions))
            scores.append(_score(known, surface, depth_mm))
        except InputError:
            scores.append((None, None))
    (near, near_height), (parallel, parallel_height) = scores
    return LightingRow(
        *light,
        100.0 * any_dark / pressed,
        100.0 * two_dark / pressed,
        near,
        parallel,
        near_height,
        parallel_height,
    )


def _score(known: KnownSensor, surface: PressedSurface, depth_mm: float) -> tuple[float, float]:
    """Return the RMS of the depth in um, and the error of the plateau in percent."""
    seen = known.showing(surface, samples=1)
    found = Reconstructor(known.calibration).depth(seen.frame, normals=False)
    radius_mm = scored_radius_mm(known.calibration.sensor)
    truth = TrueDepth(surface.depth_mm, surface.x_mm, surface.y_mm)
    score = score_depth(
        found.depth_mm, found.x_mm, found.y_mm, truth, height_mm=depth_mm, radius_mm=radius_mm
    )
    return score.rms_um, score.height_percent
