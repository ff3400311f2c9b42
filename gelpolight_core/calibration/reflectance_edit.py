"""Edit the reflectance table by hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.light.directions import flat_cosines
from gelpolight_core.light.membrane_brdf import CURVE_NODES, MembraneBrdf
from gelpolight_core.light.reflectance_table import LEAST_STEP, ReflectanceTable
from gelpolight_core.sensor.sensor_calibration import Calibration, ManualEdit

CurveNodes = tuple[Float64Array, Float64Array]
# Below this share of a curve's brightest value, its relative change is meaningless.
LEAST_SHARE = 0.01


def with_edited_curves(
    calibration: Calibration, curves: Mapping[int, CurveNodes], *, operator: str, made: str
) -> Calibration:
    """Return the calibration with reflectance curves drawn by the user.

    The paper's model uses the curve as drawn. In the full model the diffuse share is multiplied by
    the change, new curve over old; its gloss stays. The reflectance factors (Eq. 9) are updated, so
    that the bare membrane stays flat for any curve.

    Parameters
    ----------
    calibration : Calibration
        The original, which is not modified.
    curves : mapping of int to (cosines, values)
        By channel (0 red, 1 green, 2 blue), nodes (N,) of G: cosines from 0 to 1, processed values
        I / (rho |L|). Channels that are missing, or not changed, stay.
    operator : str
        Name of the user.
    made : str
        ISO 8601 time with zone.

    Raises
    ------
    InputError
        If a curve is not finite, does not span 0 to 1, or does not increase everywhere.
    """
    sensor = calibration.open_sensor
    old = sensor.reflectance
    cosines, values = list(old.cosines), list(old.values)
    changed = []
    for channel, curve in sorted(curves.items()):
        nodes, drawn = _checked(channel, curve)
        same = np.array_equal(nodes, cosines[channel]) and np.array_equal(drawn, values[channel])
        if not same:
            cosines[channel], values[channel] = nodes, drawn
            changed.append(channel)
    if not changed:
        return calibration
    new = ReflectanceTable(
        (cosines[0], cosines[1], cosines[2]), (values[0], values[1], values[2]), old.coverage
    )
    flat = flat_cosines(sensor.table, sensor.led_positions_mm)
    factors = sensor.factors.copy()
    for k in changed:
        valid_mask = factors[..., k] > 0.0
        cosine = flat[valid_mask, k]
        factors[valid_mask, k] *= old.response(k, cosine) / new.response(k, cosine)
    full = sensor.full
    if full is not None:
        middle = flat[flat.shape[0] // 2, flat.shape[1] // 2]
        full = replace(full, membrane=with_edited_diffuse(full.membrane, old, new, changed, middle))
    edit = ManualEdit("reflectance", tuple(CHANNEL_KEYS[k] for k in changed), made, operator)
    provenance = replace(calibration.provenance, edits=(*calibration.provenance.edits, edit))
    new_sensor = replace(sensor, reflectance=new, factors=factors, full=full)
    return replace(calibration, data=new_sensor, provenance=provenance)


def with_edited_diffuse(
    membrane: MembraneBrdf,
    old: ReflectanceTable,
    new: ReflectanceTable,
    channels: list[int],
    flat_cosine: Float64Array,
) -> MembraneBrdf:
    """Multiply a membrane's diffuse share by the change of a table.

    Parameters
    ----------
    membrane : MembraneBrdf
        The original membrane.
    old, new : ReflectanceTable
        Before and after.
    channels : list of int
        The edited channels.
    flat_cosine : (3,)
        Cosine of each light on the flat membrane. Presses are compared with the contact-free image,
        so the height of a curve has no meaning; the share keeps its brightness at this cosine.
    """
    even = np.linspace(0.0, 1.0, CURVE_NODES)
    share = membrane.diffuse_share(np.repeat(even[:, None], 3, axis=1)).T
    for k in channels:
        before, after = old.response(k, even), new.response(k, even)
        valid_mask = before > LEAST_SHARE * before[-1]
        ratio = np.interp(even, even[valid_mask], after[valid_mask] / before[valid_mask])
        ratio /= np.interp(flat_cosine[k], even, ratio)
        curve = np.maximum.accumulate(share[k] * ratio)
        ramp = LEAST_STEP * curve[-1] * np.arange(CURVE_NODES)
        share[k] = np.maximum.accumulate(curve - ramp) + ramp
    return replace(membrane, diffuse=tuple(tuple(curve) for curve in share.tolist()))


def _checked(channel: int, curve: CurveNodes) -> CurveNodes:
    """Return a curve's nodes as float64, or raise an error that says what is wrong."""
    if channel not in range(3):
        raise ValueError(f"channel {channel}")
    nodes, values = (np.array(part, np.float64) for part in curve)
    if nodes.ndim != 1 or nodes.shape != values.shape or nodes.size < 2:
        message = f"The curve has {nodes.size} cosines and {values.size} values"
    elif not (np.isfinite(nodes).all() and np.isfinite(values).all()):
        message = "The curve contains values that are not numbers"
    elif nodes[0] != 0.0 or nodes[-1] != 1.0 or (np.diff(nodes) <= 0.0).any():
        message = "The cosines of the curve do not increase from 0 to 1"
    elif values[0] < 0.0 or (np.diff(values) <= 0.0).any():
        message = "The curve does not increase everywhere from 0 or above"
    else:
        return nodes, values
    raise InputError(
        message,
        f"reflectance, {CHANNEL_KEYS[channel]} channel",
        Remedy.MOVE_NODES,
    )
