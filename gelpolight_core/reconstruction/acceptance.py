"""What a reconstruction takes: pictures of the right kind, lights that can be solved.

And whether a picture can be of this sensor at all: around the contact the membrane must look as the
calibration says. A wrong exposure, colour order or sensor changes it everywhere, and then the depth
means nothing however smooth it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.errors import InputError
from gelpolight_core.lights.positions import (
    CONDITION_LIMIT,
    direction_condition,
    light_directions,
)
from gelpolight_core.translation import tr

Map = NDArray[np.float32]
BYTES_OF_KIND = {"u": (1, 2), "f": (2, 4, 8, 12, 16)}
RIM_MM = 1.0
RIM_NODES = 720
"""Nodes of the rim that are looked at: two for each degree."""
RIM_CHANGE = 0.05
RIM_SIGMAS = 4.0
LEAST_BASE = 0.01
LEAST_FITTING = 0.5
"""A contact over more than half of the rim leaves nothing that the depth could rest on."""
UNSOLVED_SHARE = 1e-3
"""Walls of 57 degrees leave 0.001 %, of 71 degrees 0.14 %, of 76 degrees 0.2 %: 2 % of height."""
MOST_DRIFT = 0.01
"""Light of 1 % more than at calibration makes a 1 mm press 8 % higher, and the rim shows 0.1 %."""
LEAST_USABLE = 0.02
USABLE_STEP = 8


def accepted(frame: NDArray[Any], *, name: str) -> NDArray[Any]:
    """Return a frame as uint8, uint16 or float32 in this machine's byte order.

    Floats are limited to 0..1, so that no wild value spreads to its neighbours: below there is no
    light, above the pixel is saturated. What is not a number stays so and counts as missing.

    Parameters
    ----------
    frame : array
        Any numbers.
    name : str
        What a message calls it.

    Raises
    ------
    InputError
        If the frame holds other numbers.
    """
    kind, size = frame.dtype.kind, frame.dtype.itemsize
    if size not in BYTES_OF_KIND.get(kind, ()):
        raise InputError(
            tr("the picture holds values of type {kind}").format(kind=frame.dtype),
            where=name or tr("picture"),
            advice=tr("Give 8 or 16 bit numbers without sign, or floats of linear light 0..1"),
        )
    if kind == "u":
        return frame.astype(frame.dtype.newbyteorder("="), copy=False)
    if frame.dtype == np.float32 and frame.min() >= 0.0 and frame.max() <= 1.0:
        return frame.astype(np.float32, copy=False)
    limited: Map = np.clip(frame, 0.0, 1.0).astype(np.float32)
    limited[~np.isfinite(frame)] = np.nan
    return limited


def rim_let_go() -> str:
    """Return the note on a map whose rim a contact crosses; its depth is as good as any."""
    return tr("a contact crosses the rim: the rim was let go there")


def unsolved_note(share: float) -> str:
    """Return what is to be said of nodes that light alone does not decide; empty where few are."""
    if share <= UNSOLVED_SHARE:
        return ""
    return tr(
        "{percent:.1f} % of the membrane is lit by less than two LEDs or turned away from the "
        "camera, as on steep walls: what stands on them may come out too low"
    ).format(percent=100.0 * share)


def refuse_coplanar_lights(calibration: Calibration, leds_mm: NDArray[np.float64]) -> None:
    """Refuse lights whose directions at the middle of the sensor lie nearly in one plane.

    Raises
    ------
    InputError
        If their condition number is above the limit of the LED stage, or none.
    """
    condition = np.inf
    if np.isfinite(leds_mm).all() and (leds_mm[:, 2] < 0.0).all():
        condition = direction_condition(leds_mm, np.zeros(2))
    if not condition <= CONDITION_LIMIT:
        raise InputError(
            tr("the three light directions are nearly in one plane (condition {c:.0f})").format(
                c=condition
            ),
            where=calibration.identity,
            advice=tr("Place the LEDs wider apart around the sensor's axis, and calibrate again"),
        )


def refuse_dark_membrane(calibration: Calibration) -> None:
    """Refuse a calibration that has light on next to nothing of the membrane.

    Raises
    ------
    InputError
        If fewer than `LEAST_USABLE` of the nodes in view are lit in all channels.
    """
    thin = np.s_[::USABLE_STEP, ::USABLE_STEP]
    light = calibration.radiance[thin] * calibration.factors[thin]
    lit = light > 0.0
    if calibration.full is not None:
        lit &= calibration.full.background[thin] > LEAST_BASE
    seen = calibration.table.valid[thin]
    share = float(np.count_nonzero(seen & lit.all(axis=2))) / max(int(seen.sum()), 1)
    if not share > LEAST_USABLE:
        raise InputError(
            tr("all three LEDs light {share:.1f} % of the membrane").format(share=100.0 * share),
            where=calibration.identity,
            advice=tr("Place the LEDs lower, or calibrate again with more light"),
        )


@dataclass(frozen=True, slots=True)
class RimCheck:
    """Nodes along the rim, and what the untouched membrane shows there.

    Attributes
    ----------
    row, column : (nodes,) int
        Raw pixels.
    expected : (nodes, 3) float32
        Raw value 0..1 of linear light.
    allowed : (nodes, 3) float32
        How far a pixel may be from it.
    """

    row: NDArray[np.intp]
    column: NDArray[np.intp]
    expected: Map
    allowed: Map

    def note(self, seen: Map) -> str:
        """Return what is to be said of a picture; empty where it fits.

        Parameters
        ----------
        seen : (nodes, 3) float32
            Its linear light at the pixels.
        """
        # A missing value fits nothing.
        fits = (np.abs(seen - self.expected) <= self.allowed).all(axis=1)
        if not fits.size:
            return ""
        if fits.mean() >= LEAST_FITTING:
            return _drift_note(np.median(seen[fits] / self.expected[fits], axis=0) - 1.0)
        return tr(
            "most of the rim does not look like this sensor's membrane: another exposure, colour "
            "order or sensor, or a contact beyond the whole field; the depth is not to be trusted"
        )


def _drift_note(drift: NDArray[np.floating]) -> str:
    """Return what is to be said of light that has drifted by some share of each channel."""
    worst = float(drift[np.argmax(np.abs(drift))])
    if abs(worst) <= MOST_DRIFT:
        return ""
    return tr(
        "the rim's brightness is {percent:+.1f} % off its calibration: exposure or LEDs have "
        "drifted, and the depth with them; take the background again"
    ).format(percent=100.0 * worst)


def rim_check(calibration: Calibration) -> RimCheck:
    """Gather the nodes along the rim with what the untouched membrane shows there."""
    table = calibration.table
    grid = table.grid
    y_last, x_last = grid.shape[0] - 1, grid.shape[1] - 1
    angle = np.linspace(0.0, 2.0 * np.pi, RIM_NODES, endpoint=False)
    radius = 0.5 * calibration.sensor.working_diameter_mm - RIM_MM
    x = np.clip(radius * np.cos(angle), grid.x_mm[0] + RIM_MM, grid.x_mm[-1] - RIM_MM)
    y = np.clip(radius * np.sin(angle), grid.y_mm[0] + RIM_MM, grid.y_mm[-1] - RIM_MM)
    nodes = np.rint(grid.to_index(np.stack([x, y], axis=-1))).astype(np.intp)
    column, row = np.clip(nodes[:, 0], 0, x_last), np.clip(nodes[:, 1], 0, y_last)
    expected = _untouched(calibration, row, column)
    known = table.valid[row, column] & (expected > LEAST_BASE).all(axis=1)
    row, column, expected = row[known], column[known], expected[known]
    allowed = RIM_CHANGE * expected + RIM_SIGMAS * calibration.noise
    return RimCheck(
        np.rint(table.v_px[row, column]).astype(np.intp),
        np.rint(table.u_px[row, column]).astype(np.intp),
        np.asarray(expected, np.float32),
        np.asarray(allowed, np.float32),
    )


def _untouched(
    calibration: Calibration, row: NDArray[np.intp], column: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Return the raw light (nodes, 3) of the untouched membrane at some nodes."""
    if calibration.full is not None:
        light = calibration.full.background[row, column].astype(np.float64)
        return np.asarray(light @ calibration.crosstalk.T)
    grid = calibration.table.grid
    at_top = np.stack([grid.x_mm[column], grid.y_mm[row], np.zeros(row.size)], axis=-1)
    light, _ = light_directions(calibration.led_positions_mm, at_top)
    strength = calibration.radiance[row, column] * calibration.factors[row, column]
    shown = [calibration.reflectance.response(k, -light[:, k, 2]) for k in range(3)]
    return np.asarray(strength * np.stack(shown, axis=-1), np.float64)
