"""Find the reflections of the three LEDs in a mirror image."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from app.calibrate.detection import Detection, as_image, judged, or_refusal
from app.calibrate.marks import LED_ROLES, spot_markers, spot_mask
from app.live.image_checks import Rgb
from app.live.overlay import Marker, Overlay
from gelpolight_core.lights.mirror import find_mirror_spots
from gelpolight_core.quality import judge
from gelpolight_core.session.session import Session
from gelpolight_core.translation import tr

Array = NDArray[np.float64]

# A spot this far from its expected position cannot be explained by mounting tolerances.
LED_OFF_OF_WIDTH = 0.05


def detect_mirror(
    rgb: Rgb, *, expected_px: Array | None = None, editable: bool = False
) -> Detection:
    """Find the reflections of the LEDs.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    expected_px : (3, 2), optional
        Expected positions of the spots, from :func:`app.calibrate.marks.mirror_positions_px`.
    editable : bool, optional
        Whether the spots can be dragged; their handles are mirror.0, mirror.1 and mirror.2.
    """
    positions = () if expected_px is None else tuple(expected_px)
    expected = tuple(
        Marker(float(u), float(v), "ring", "expected", text=tr("expected")) for u, v in positions
    )

    def detect() -> Detection:
        spots = find_mirror_spots(as_image(rgb))
        marks = Overlay(
            markers=(*expected, *spot_markers(spots, editable=editable)),
            masks=tuple(
                spot_mask(rgb, spot, role)
                for spot, role in zip(spots.spots, LED_ROLES, strict=True)
            ),
        )
        figures = spots.quality.figures
        if expected_px is not None:
            off = float(np.linalg.norm(spots.centres_px - expected_px, axis=1).max())
            figures += (
                judge("spot_off_px", tr("Largest spot offset"), off, "px",
                      warn=LED_OFF_OF_WIDTH * rgb.shape[1],
                      advice=tr("Check the channel of each LED, and that the mirror is flat")),
            )  # fmt: skip
        return judged(marks, figures, tr("All three LED reflections were found."), spots)

    return or_refusal(detect, marks=Overlay(markers=expected))


def placed_spots(rgb: Rgb, session: Session) -> Detection:
    """Show the manually placed spots as handles that can be moved again."""

    def detect() -> Detection:
        spots = find_mirror_spots(as_image(rgb), placed=session.decisions.spots_px)
        marks = Overlay(markers=spot_markers(spots, editable=True))
        return judged(marks, spots.quality.figures, tr("The spots were placed by hand."), spots)

    return or_refusal(detect)
