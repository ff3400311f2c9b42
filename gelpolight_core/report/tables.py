"""Tables of a calibration's report."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import PurePath

import numpy as np

from gelpolight_core.arrays import Array
from gelpolight_core.calibration.joint import JointResult
from gelpolight_core.channels import CHANNEL_KEYS
from gelpolight_core.in_place.calibrate import InPlaceResult
from gelpolight_core.lights.mirror import MirrorSpots
from gelpolight_core.optics.lens import LensResult
from gelpolight_core.reconstruction.in_place.calibration import ClosedSensor
from gelpolight_core.reflectance.press import BallPress
from gelpolight_core.report.document import Listing, listing


def crosstalk_shares(crosstalk: Array) -> Listing:
    """Return the share of each LED's light that the other channels see.

    Parameters
    ----------
    crosstalk : (3, 3)
        ``I_raw = crosstalk @ I_true``; column k is LED k.
    """
    heads = ("", *(f"{CHANNEL_KEYS[k]} LED" for k in range(3)))
    rows = []
    for j, shares in enumerate(crosstalk):
        name = f"seen by the {CHANNEL_KEYS[j]} channel"
        cells = ("" if j == k else f"{100.0 * share:.2f} %" for k, share in enumerate(shares))
        rows.append((name, *cells))
    title = "Share of each LED's light that the other two channels see"
    return Listing(title, heads, tuple(rows))


def left_out_views(lens: LensResult) -> Listing:
    """Return the checkerboard views that were left out, each with the reason."""
    return listing(
        "Views left out",
        (view for view in lens.views if not view.used),
        ("image", lambda view: view.name),
        ("reason", lambda view: view.reason),
        ("advice", lambda view: view.advice),
    )


def rejected_glints(spots: MirrorSpots) -> Listing:
    """Return the spots on the mirror that are no LED, each with the reason."""
    return listing(
        "Rejected glints",
        enumerate(spots.rejected, start=1),
        ("number", lambda item: str(item[0])),
        ("position (px)", lambda item: "({:.1f}, {:.1f})".format(*item[1][0].centre_px)),
        ("reason", lambda item: item[1][1]),
    )


def ball_presses(presses: Sequence[BallPress]) -> Listing:
    """Return every ball press with its verdict."""

    def verdict(press: BallPress) -> str:
        word = f"{press.quality.verdict.sign} {press.quality.verdict.word}"
        return ": ".join((word, *press.quality.remedies))

    return listing(
        "Ball presses (lengths in mm)",
        presses,
        ("image", lambda press: PurePath(press.name).name),
        ("ball radius", lambda press: f"{press.pose.radius_mm:.3f}"),
        ("centre", lambda press: "({:.3f}, {:.3f})".format(*press.pose.centre_mm)),
        ("depth", lambda press: f"{press.pose.depth_mm:.3f}"),
        ("contact radius", lambda press: f"{press.contact_radius_mm:.3f}"),
        ("misfit", lambda press: f"{100.0 * press.shading_misfit:.1f} %"),
        ("verdict", verdict),
    )


def refined_presses(presses: Sequence[BallPress], joint: JointResult) -> Listing:
    """Return the residual of each press before and after the joint refinement, and its shift.

    Parameters
    ----------
    presses : sequence of BallPress
        With the misfit of their separate refinement.
    joint : JointResult
        With the misfit of each press after the joint refinement.
    """

    def moved(k: int) -> Array:
        before, after = presses[k].pose, joint.balls[k]
        x_mm, y_mm = np.subtract(after.centre_mm, before.centre_mm)
        return 1e3 * np.array([x_mm, y_mm, after.depth_mm - before.depth_mm])

    return listing(
        "Residual of each ball press, and the shift of the balls by the joint refinement",
        range(len(presses)),
        ("image", lambda k: PurePath(presses[k].name).name),
        ("misfit alone", lambda k: f"{100.0 * presses[k].shading_misfit:.2f} %"),
        ("misfit together", lambda k: f"{100.0 * joint.ball_misfits[k]:.2f} %"),
        ("shift in x (\N{MICRO SIGN}m)", lambda k: f"{moved(k)[0]:+.1f}"),
        ("shift in y (\N{MICRO SIGN}m)", lambda k: f"{moved(k)[1]:+.1f}"),
        ("shift in depth (\N{MICRO SIGN}m)", lambda k: f"{moved(k)[2]:+.1f}"),
    )


def closed_presses(c: ClosedSensor, result: InPlaceResult) -> Listing:
    """Return every press of a closed sensor, compared with the other presses."""

    def percent(ratio: float) -> str:
        return f"{100.0 * (ratio - 1.0):+.1f} %" if math.isfinite(ratio) else ""

    return listing(
        "Each press compared with the other presses",
        zip(c.balls, (press.held_out for press in result.presses), strict=True),
        ("image", lambda press: PurePath(press[0][0]).name),
        ("radius (mm)", lambda press: f"{press[0][4]:.3f}"),
        ("position (mm)", lambda press: f"{press[0][1]:.2f}, {press[0][2]:.2f}"),
        ("contact (mm)", lambda press: f"{press[0][3]:.2f}"),
        ("normals", lambda press: f"{press[1].normal_deg:.2f}\N{DEGREE SIGN}"),
        ("height", lambda press: percent(press[1].cap_ratio)),
        ("diameter", lambda press: percent(press[1].diameter_ratio)),
    )


def refused_presses(result: InPlaceResult) -> Listing:
    """Return the presses of a closed sensor that were left out, each with the reason."""
    return listing(
        "Presses left out",
        sorted(result.refused.items()),
        ("image", lambda item: PurePath(item[0]).name),
        ("reason", lambda item: f"{item[1].found}. {item[1].advice}."),
    )
