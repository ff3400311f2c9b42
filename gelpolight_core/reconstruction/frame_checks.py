"""Checks before and after a reconstruction: valid images, solvable lights, notes on the map."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding, HeightReliability, Verdict
from gelpolight_core.base.membrane_masks import usable_mask
from gelpolight_core.health.fault_limits import SIGMAS
from gelpolight_core.light.directions import direction_condition
from gelpolight_core.sensor.sensor_calibration import OpenSensor
from gelpolight_core.stages.leds.led_positions import CONDITION_LIMIT

from .height_map import Flag

BYTES_OF_KIND = {"u": (1, 2), "f": (2, 4, 8, 12, 16)}
BOUNDARY_MM = 1.0
"""Distance from the boundary of the field at which the paper's model is checked for contact."""
HELD_DOWN_MM, HELD_DOWN_SHARE = 0.03, 0.2
"""Depth there, and share of the deepest, that shows a contact across the boundary although the
boundary is fixed at depth 0. It is more than the drape of a contact that ends 2 mm inside, and more
than the error of the paper's model."""
PRESSED_SHARE = 0.1
"""Nodes deeper than this share of the deepest are pressed or draped."""
ONE_DARK_SHARE = 0.25
"""Share of the pressed nodes in the shadow of an LED. Faces of 1 mm with a drape of 0.7 mm have
0.16; walls of 71 degrees 0.34 and 3 % of the height, of 84 degrees 0.31 and 7 %."""
FROZEN_SHARE = 0.25
"""Depth over the height of the lowest LED: at 0.3, the lights of the flat membrane cause an error
of 5 % of the depth."""
THIN = 4
MOST_CONDITION = 39.0
"""Condition number of the light directions: above it, depths scatter more than their standard
deviations state."""
STRONG_FEEDBACK, UNSETTLED_SHARE = 0.8, 0.01
"""Gain of the light between walls from which an error grows five times, and the share of the depth
that further rounds must still add for that to be said."""
UNSOLVED_SHARE = 1e-3
"""Walls of 57 degrees leave 0.001 %, of 71 degrees 0.14 %, of 76 degrees 0.2 %: 2 % of height."""
MOST_PITCH = 0.25
"""Node distance over the drape's decay length: at 0.28 a cylinder of 1 mm loses 4 % of its height,
at 0.7 8 %."""
MOST_LOST = 0.02
"""Share of a depth that the nodes may take without a word: half of the height error from which on a
calibration fails."""
MOST_HIDDEN_MM = 0.1
"""Sensors of 320 x 240 pixels and 50 dB show 25 um; a depth of 0 from a worse one needs a note."""
LEAST_USABLE = 0.02


def validate_frame(frame: NDArray[Any], *, name: str) -> NDArray[Any]:
    """Return a frame as uint8, uint16 or float32 in this machine's byte order.

    Floats are limited to 0..1, so that no extreme value spreads to its neighbours: values below 0
    mean no light, values above 1 mean saturation. Values that are not numbers count as missing.

    Parameters
    ----------
    frame : array
        Any numbers.
    name : str
        Its name in messages.

    Raises
    ------
    InputError
        If the frame contains other numbers, or floats far above 1.
    """
    kind, size = frame.dtype.kind, frame.dtype.itemsize
    if size not in BYTES_OF_KIND.get(kind, ()):
        raise InputError(
            f"the image contains values of type {frame.dtype}",
            name or "image",
            Remedy.LINEAR_ARRAY,
        )
    if kind == "u":
        return frame.astype(frame.dtype.newbyteorder("="), copy=False)
    if frame.dtype == np.float32 and frame.min() >= 0.0 and frame.max() <= 1.0:
        return frame.astype(np.float32, copy=False)
    finite = frame[np.isfinite(frame)]
    # An image of floats with a larger median is not linear light 0..1, but counts from 0 to 255.
    if finite.size and (median := float(np.median(finite))) > 2.0:
        raise InputError(
            f"the median of the image is {median:.4g}, but floats are linear light 0..1",
            name or "image",
            Remedy.LINEAR_ARRAY,
        )
    limited: Float32Array = np.clip(frame, 0.0, 1.0).astype(np.float32)
    limited[~np.isfinite(frame)] = np.nan
    return limited


def _note(key: str, text: str, heights: HeightReliability = HeightReliability.DOUBTFUL) -> Finding:
    return Finding(key, text, verdict=Verdict.WARN, heights=heights)


def free_boundary_note() -> Finding:
    """Return the note on a map whose boundary a contact crosses, with accurate depth."""
    text = "a contact crosses the boundary of the field: the boundary is free there"
    return Finding("free_boundary", text)


def fixed_boundary_note() -> Finding:
    """Return the note on a map of the paper's model whose boundary a contact crosses."""
    return _note(
        "fixed_boundary",
        (
            "a contact crosses the boundary of the field, where the paper's model holds depth 0: "
            "depths are too small; use the full model, or press nearer to the middle"
        ),
    )


def paper_notes(
    depth_mm: Float32Array, flags: NDArray[np.uint8], least_height_mm: float
) -> tuple[Finding, ...]:
    """Return the notes on a map that violates the assumptions of the paper's model.

    It assumes three lights, with the directions at the undeformed surface.

    Parameters
    ----------
    depth_mm, flags : (rows, columns)
        The map.
    least_height_mm : float
        From the lowest LED to the undeformed surface.
    """
    thin = np.s_[::THIN, ::THIN]
    depth = depth_mm[thin]
    deepest = float(depth.max(initial=0.0))
    pressed = depth > max(PRESSED_SHARE * deepest, HELD_DOWN_MM)
    dark = pressed & ((flags[thin] & np.uint8(Flag.DARK)) != 0)
    share = int(np.count_nonzero(dark)) / max(int(np.count_nonzero(pressed)), 1)
    notes = []
    if share > ONE_DARK_SHARE:
        text = (
            "{percent:.0f} % of the contact lies in the shadow of an LED, which the "
            "paper's model ignores: heights on steep walls may be too low; use the "
            "full model"
        )
        notes.append(_note("shadow", text.format(percent=100.0 * share)))
    if deepest > FROZEN_SHARE * least_height_mm:
        text = (
            "the press is deep for its lights, and the paper's model uses the light "
            "of the undeformed surface: depths may be wrong by 5 % or more; use the "
            "full model"
        )
        notes.append(_note("deep_for_lights", text))
    return tuple(notes)


def condition_notes(calibration: OpenSensor, leds_mm: NDArray[np.float64]) -> tuple[Finding, ...]:
    """Return the note on light directions that are nearly coplanar somewhere, if they are."""
    table = calibration.table
    points = table.grid.points_mm()[table.valid]
    if not points.size:
        return ()
    condition = direction_condition(leds_mm, points[:: max(len(points) // 2000, 1)])
    if condition <= MOST_CONDITION:
        return ()
    text = (
        "the light directions lie nearly in one plane in part of the field (condition number "
        "{c:.0f}): depths scatter more than stated; place the LEDs wider apart"
    )
    return (_note("light_condition", text.format(c=condition)),)


def unanchored_note() -> Finding:
    """Return the note on a map without an anchor, which may be wrong by a constant.

    Not doubtful: depth differences are valid, and the flag makes the others doubtful.
    """
    text = (
        "nearly all of the boundary is pressed: depth differences within the map "
        "are valid, but all depths may be wrong by one constant; press so that "
        "more of the boundary stays free"
    )
    return _note("unanchored", text, HeightReliability.STATED)


def rounds_notes(stopped: str) -> tuple[Finding, ...]:
    """Return the note on near-light rounds that ended in this way, if it matters."""
    texts = {
        "damped": "the press is deep for its lights: the near-light rounds were damped",
        "unsettled": "the near-light rounds did not converge: damping did not help",
        "grows": "the near-light rounds did not converge: the last round was undone",
    }
    heights = HeightReliability.STATED if stopped == "damped" else HeightReliability.DOUBTFUL
    return (_note("rounds", texts[stopped], heights),) if stopped in texts else ()


def feedback_notes(gain: float, left_mm: float, deepest_mm: float) -> tuple[Finding, ...]:
    """Return the note on light between parts of the membrane that no round has settled.

    Parameters
    ----------
    gain : float
        Share of a move by which the next round moves.
    left_mm, deepest_mm : float
        What more rounds would still add, and the largest depth.
    """
    if gain < STRONG_FEEDBACK or left_mm < UNSETTLED_SHARE * deepest_mm:
        return ()
    text = (
        "walls send so much light to each other that an error of the light grows {times:.0f} "
        "times: heights may be wrong by {percent:.0f} %; press less deep"
    )
    text = text.format(times=1.0 / (1.0 - gain), percent=100.0 * left_mm / deepest_mm)
    return (_note("light_feedback", text, HeightReliability.STATED),)


def unsolved_notes(share: float, *, fits: bool) -> tuple[Finding, ...]:
    """Return the note on nodes that the light alone does not determine, if there are many.

    The depth is doubtful where the rest of the contact does not fit the surface either.
    """
    if share <= UNSOLVED_SHARE:
        return ()
    text = (
        "{percent:.1f} % of the membrane is lit by less than two LEDs or faces "
        "away from the camera, as on steep walls: heights there may be too low"
    )
    heights = HeightReliability.STATED if fits else HeightReliability.DOUBTFUL
    return (_note("steep_walls", text.format(percent=100.0 * share), heights),)


def small_image_notes(pitch_mm: float, decay_mm: float) -> tuple[Finding, ...]:
    """Return the note on a map whose nodes do not resolve the drape, if they do not."""
    if pitch_mm <= MOST_PITCH * decay_mm:
        return ()
    text = (
        "the image is too small for this membrane: one pixel covers {p:.2f} mm, "
        "and the decay length of the drape is {d:.2f} mm; heights may be too low "
        "by several percent; use larger images"
    )
    return (_note("small_image", text.format(p=pitch_mm, d=decay_mm)),)


def too_coarse_notes(
    top: tuple[float, float], noise_mm: float, node_mm: float
) -> tuple[Finding, ...]:
    """Return the note on a map whose nodes do not resolve its deepest top, if they do not.

    Parameters
    ----------
    top : (float, float)
        Depth, and what the nodes take from it, in mm.
    noise_mm : float
        Standard deviation of the depth of the smallest visible face.
    node_mm : float
        Distance between the solved nodes.
    """
    depth_mm, lost_mm = top
    if lost_mm <= max(MOST_LOST * depth_mm, SIGMAS * noise_mm):
        return ()
    text = (
        "the deepest point is finer than nodes of {p:.2f} mm resolve: its depth may be {um:.0f} "
        "\N{MICRO SIGN}m too small; use a finer effort or larger images"
    )
    return (_note("too_coarse", text.format(p=node_mm, um=1e3 * lost_mm)),)


def visible_depth_notes(visible_mm: float) -> tuple[Finding, ...]:
    """Return the note on a map without a contact, of a sensor that hides deep ones."""
    if visible_mm <= MOST_HIDDEN_MM:
        return ()
    text = (
        "no contact was found, but this calibration's noise hides faces of less than {um:.0f} "
        "\N{MICRO SIGN}m: calibrate again with more light or less gain"
    )
    return (_note("hidden_depth", text.format(um=1e3 * visible_mm)),)


def refuse_unsolvable(
    calibration: OpenSensor, leds_mm: NDArray[np.float64], light: Float32Array
) -> None:
    """Refuse lights nearly in one plane, and light on almost no part of the membrane.

    Parameters
    ----------
    calibration : OpenSensor
        Calibrated data of the sensor.
    leds_mm : (3, 3)
        LED positions that the model uses.
    light : (rows, columns, 3)
        Light of the membrane that the model uses.

    Raises
    ------
    InputError
        If the condition number of the light directions at the middle of the sensor is above the
        limit of the LED stage, or if fewer than `LEAST_USABLE` of the nodes in view are lit in all
        channels.
    """
    condition = np.inf
    if np.isfinite(leds_mm).all() and (leds_mm[:, 2] < 0.0).all():
        condition = direction_condition(leds_mm, np.zeros(2))
    if not condition <= CONDITION_LIMIT:
        raise InputError(
            (
                "The three light directions lie nearly in one "
                f"plane (condition number {condition:.0f})"
            ),
            calibration.serial,
            Remedy.WIDER_LEDS,
        )
    thin = np.s_[::8, ::8]
    valid = calibration.table.valid[thin]
    lit = usable_mask(valid, light[thin], calibration.factors[thin])
    share = float(np.count_nonzero(lit)) / max(int(valid.sum()), 1)
    if not share > LEAST_USABLE:
        raise InputError(
            f"only {100.0 * share:.1f} % of the membrane is lit by all three LEDs",
            calibration.serial,
            "Place the LEDs lower, or calibrate again with more light",
        )


def contact_crosses(
    depth_mm: Float32Array, nodes: tuple[NDArray[np.intp], NDArray[np.intp]]
) -> bool:
    """Return whether a depth map has a contact at `boundary_nodes`."""
    deepest = np.abs(depth_mm[nodes]).max(initial=0.0)
    return bool(deepest > max(HELD_DOWN_MM, HELD_DOWN_SHARE * float(depth_mm.max())))


def boundary_nodes(calibration: OpenSensor) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return row and column of nodes a millimetre inside the boundary of the field."""
    table = calibration.table
    grid = table.grid
    angle = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    radius = 0.5 * calibration.sensor.working_diameter_mm - BOUNDARY_MM
    x, y = (
        np.clip(radius * side, axis[0] + BOUNDARY_MM, axis[-1] - BOUNDARY_MM)
        for side, axis in ((np.cos(angle), grid.x_mm), (np.sin(angle), grid.y_mm))
    )
    nodes = np.rint(grid.to_index(np.stack([x, y], axis=-1))).astype(np.intp)
    column = np.clip(nodes[:, 0], 0, grid.shape[1] - 1)
    row = np.clip(nodes[:, 1], 0, grid.shape[0] - 1)
    valid = table.valid[row, column]
    return row[valid], column[valid]
