"""The accuracy from the present presses, and the expected benefit of one more."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from app.calibrate.closed_balls.detector import to_px
from app.calibrate.maps import Panel
from app.view2d.map_view import extent_of
from gelpolight_core.calibration.in_place_session import SETTLED, InPlaceRun, expected_gain
from gelpolight_core.translation import tr

GOOD_DEG, FAIR_DEG = 4.0, 8.0
"""Residuals of a press up to which its mark is green, and yellow."""
COLOURS = ((60, 200, 90), (240, 190, 50), (230, 70, 60))
SHOWN_PX = 640


@dataclass(frozen=True, slots=True)
class Progress:
    """Accuracy of an in-place calibration, and whether more presses help.

    Attributes
    ----------
    error_deg : float
        Mean error of the normals of presses that were left out.
    gain : float or None
        Relative decrease of the error by one more press; None with too few presses.
    curve : tuple of (int, float)
        Numbers of presses, and the typical errors with them, degrees.
    next_px : (u, v) or None
        Where the next press helps most; None if more presses do not help.
    """

    error_deg: float
    gain: float | None
    curve: tuple[tuple[int, float], ...]
    next_px: tuple[float, float] | None

    @property
    def settled(self) -> bool:
        """Whether more presses do not help."""
        return self.gain is not None and self.gain < SETTLED

    def sentence(self) -> str:
        """Return the state and what to do next."""
        text = tr("Expected error of the normals: {e:.1f} degrees.").format(e=self.error_deg)
        if self.curve:
            text += " " + tr("With {counts} presses it was about {errors}.").format(
                counts=", ".join(str(n) for n, _ in self.curve),
                errors=", ".join(f"{e:.1f}" for _, e in self.curve),
            )
        if self.gain is None:
            return text + " " + tr("Press more balls. The next one helps most at the ring.")
        if self.settled:
            return text + " " + tr("More presses do not help. Go to the next step.")
        more = tr("One more press lowers the error by about {g:.0f} %, most at the ring.")
        return text + " " + more.format(g=100.0 * self.gain)


def progress_of(run: InPlaceRun) -> Progress:
    """Return the progress of an in-place calibration."""
    result, gain = run.result, expected_gain(run.result)
    errors = [press.held_out.normal_deg for press in result.presses]
    settled = gain is not None and gain < SETTLED
    return Progress(
        float(np.mean(errors)),
        gain,
        tuple((n, math.degrees(math.atan(error))) for n, error in result.learning),
        None if settled else to_px(*result.next_position_mm, result.model.grid),
    )


def residual_panel(run: InPlaceRun) -> Panel:
    """Return the presses on the background, coloured by their residuals."""
    grid, progress = run.result.model.grid, progress_of(run)
    background = run.result.model.background
    rgb = (255.0 * np.clip(background / max(float(background.max()), 1e-6), 0, 1)).astype(np.uint8)
    scale = max(1, round(SHOWN_PX / rgb.shape[1]))
    rgb = cv2.resize(rgb // 2, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR)
    for press in run.result.presses:
        at = round(scale * press.ball.x), round(scale * press.ball.y)
        error = press.held_out.normal_deg
        colour = COLOURS[(error > GOOD_DEG) + (error > FAIR_DEG)]
        cv2.circle(rgb, at, round(scale * press.ball.contact), colour, 2, cv2.LINE_AA)
        _write(rgb, f"{error:.1f}", at, colour)
    if progress.next_px is not None:
        u, v = (scale * c / grid.factor for c in progress.next_px)
        cv2.circle(rgb, (round(u), round(v)), 12, (255, 255, 255), 2, cv2.LINE_AA)
        _write(rgb, tr("next"), (round(u), round(v) + 26), (255, 255, 255))
    return Panel(
        tr("Presses and their residual"),
        np.ascontiguousarray(rgb),
        extent_of(grid),
        caption=tr("Mean error of the normals of each press, in degrees, found without that press"),
    )


def _write(rgb: np.ndarray, text: str, at: tuple[int, int], colour: tuple[int, ...]) -> None:
    font = cv2.FONT_HERSHEY_SIMPLEX
    (width, height), _ = cv2.getTextSize(text, font, 0.45, 1)
    corner = at[0] - width // 2, at[1] + height // 2
    cv2.putText(rgb, text, corner, font, 0.45, colour, 1, cv2.LINE_AA)
