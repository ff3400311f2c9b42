"""Whether the touched part of a frame agrees with the surface found.

Three channels have one degree of freedom more than a normal, so every node of the contact says
whether its light is that of the surface found. It is compared with the noise, and with the level
that the calibration's own balls have left.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.finding import Finding, Heights, Verdict
from gelpolight_core.translation import tr

Map = NDArray[np.float32]
SIGMAS = 3.0
EDGES = (0.1, 0.3, 0.6, 1.0, 2.0)
"""Classes of slope: an error of the model is common to all nodes of one."""
GENTLE = 1
"""The class in which single nodes are judged: on steeper ones the width of a pixel counts, too."""
LEAST_NODES = 12
"""Nodes of a class; with fewer it says nothing."""
ROBUST = 1.4826
TOGETHER = 4.0
"""Neighbours along a row with one error, by resampling and denoising."""
OFTEN = 0.8
"""Share of the nodes that must agree: pixels at edges, beside shadows and on specks do not."""


@dataclass(frozen=True, slots=True)
class ContactLight:
    """What the surface found does not explain of the light of a contact.

    Attributes
    ----------
    stretch, stretch_sd : float
        Light of the stretched membrane over that of the model, less 1, for each unit of stretch
        (its area over the flat one's, less 1), and the standard deviation.
    spread : float
        Size of what is left on gentle slopes, in standard deviations.
    """

    stretch: float
    stretch_sd: float
    spread: float

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What this says about the height map."""
        if self.spread > SIGMAS:
            text = tr(
                "the image does not fit the surface found: what is left is {n:.1f} times that of "
                "the calibration's balls"
            )
            remedy = tr(
                "Hold object and sensor still during the exposure, clean the contact, and press "
                "again"
            )
            return (_doubtful("residual", text.format(n=self.spread), self.spread, "", remedy),)
        if abs(self.stretch) > SIGMAS * self.stretch_sd:
            percent = 100.0 * self.stretch
            text = tr(
                "the stretched membrane is {how} than in the calibration's presses, by {p:.0f} % "
                "where its area has doubled"
            )
            text = text.format(how=tr("darker") if percent < 0 else tr("brighter"), p=abs(percent))
            remedy = tr("Press the balls again and calibrate, or replace a worn membrane")
            return (_doubtful("stretched", text, percent, "%", remedy),)
        return ()


def contact_light(left: Map, step: int, misfit: float) -> ContactLight:
    """Return what is left of the light of a contact.

    Parameters
    ----------
    left : (4, rows, columns) float32
        Light that no normal explains, the whole light in the same direction, its noise, all over
        the flat membrane's, and the slope; NaN where not known.
    step : int
        Distance of the rows in nodes: half the drape's decay length.
    misfit : float
        Relative misfit of the calibration's balls.
    """
    known = np.isfinite(left[0])
    # Lamps are not points: beside a shadow they are hidden in part.
    around = np.ones((3, 2 * step + 1), np.uint8)
    clear = cv2.erode(known.astype(np.uint8), around, borderValue=1) > 0
    tilted = known & (left[3] > EDGES[0])
    rest, whole, noise, slope = left[:, tilted]
    clear = clear[tilted]
    stretch = np.sqrt(1.0 + slope**2) - 1.0
    sigma = np.hypot(noise, misfit)
    kinds = np.digitize(slope, EDGES) - 1
    top = bottom = 0.0
    for kind in range(len(EDGES) - 1):
        at = kinds == kind
        if at.sum() < LEAST_NODES:
            continue
        middle = np.median(rest[at])
        scatter = ROBUST * float(np.median(np.abs(rest[at] - middle)))
        at &= np.abs(rest - middle) < SIGMAS * scatter
        size = max(float((whole[at] ** 2).sum()), 1e-12)
        number = max(int(at.sum()), 1)
        by = float(stretch[at].mean()) if at.any() else 0.0
        variance = (misfit**2 + scatter**2 * TOGETHER / number) * number / size
        top += by * float((rest[at] * whole[at]).sum()) / size / variance
        bottom += by**2 / variance
    found = top / bottom if bottom else 0.0
    judged = clear & (kinds == GENTLE)
    spread = 0.0
    if judged.sum() >= LEAST_NODES:
        deviation = (rest - found * stretch * whole)[judged] / sigma[judged]
        usual = NormalDist().inv_cdf(0.5 * (1.0 + OFTEN))
        spread = float(np.quantile(np.abs(deviation), OFTEN)) / usual
    return ContactLight(found, bottom**-0.5 if bottom else np.inf, spread)


def _doubtful(key: str, text: str, value: float, unit: str, remedy: str) -> Finding:
    heights = Heights.DOUBTFUL
    return Finding(key, text, value, unit, verdict=Verdict.WARN, remedy=remedy, heights=heights)
