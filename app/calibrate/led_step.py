"""The lights step: glints of the LEDs in a mirror on the top surface."""

from __future__ import annotations

from functools import partial

import numpy as np

from app.live.overlay import ImageOverlay, OverlayMarker
from app.program.jobs import BackgroundJob
from gelpolight_core.base.arrays import Float64Array, PixelArray, PointXY
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import judge
from gelpolight_core.calibration.image_checks import refuse_board
from gelpolight_core.calibration.open_sensor_recipe import LENS, LIGHTS, TOP_POSE
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.session.session import Session
from gelpolight_core.stages.leds.mirror_spots import find_mirror_spots, spot_near

from .detection_marks import (
    LED_ROLES,
    Detection,
    Detector,
    as_image,
    detect_or_refusal,
    judged_detection,
    mirror_positions_px,
    spot_markers,
    spot_mask,
)
from .image_step import ImageStep

# A spot this far from its expected position cannot be explained by mounting tolerances.
LED_OFF_OF_WIDTH = 0.05


def detect_mirror(
    rgb: PixelArray,
    *,
    expected_px: Float64Array | None = None,
    editable: bool = False,
    boards: tuple[BoardSpec, ...] = (),
) -> Detection:
    """Find the reflections of the LEDs.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    expected_px : (3, 2), optional
        Expected positions of the spots, from
        :func:`app.calibrate.detection_marks.mirror_positions_px`.
    editable : bool, optional
        Whether the spots can be dragged; their handles are mirror.0, mirror.1 and mirror.2.
    boards : tuple of BoardSpec, optional
        Boards that may have been left in place of the mirror.
    """
    positions = () if expected_px is None else tuple(expected_px)
    expected = ImageOverlay(
        tuple(
            OverlayMarker(float(u), float(v), "ring", "expected", text="expected")
            for u, v in positions
        )
    )

    def detect() -> Detection:
        try:
            spots = find_mirror_spots(as_image(rgb))
        except InputError:
            refuse_board(as_image(rgb), boards, where="Image")
            raise
        masks = (spot_mask(rgb, *pair) for pair in zip(spots.spots, LED_ROLES, strict=True))
        marks = expected + ImageOverlay(spot_markers(spots, editable=editable), masks=tuple(masks))
        figures = spots.quality.figures
        if expected_px is not None:
            offset_px = float(np.linalg.norm(spots.centres_px - expected_px, axis=1).max())
            name, limit_px = "Largest spot offset", LED_OFF_OF_WIDTH * rgb.shape[1]
            remedy = "Check the channel of each LED, and that the mirror is flat"
            figures += (judge("spot_off_px", name, offset_px, "px", warn=limit_px, remedy=remedy),)
        return judged_detection(marks, figures, "All three LED reflections were found.")

    return detect_or_refusal(detect, marks=expected)


def placed_spots(rgb: PixelArray, session: Session) -> Detection:
    """Show the manually placed spots as handles that can be moved again."""

    def detect() -> Detection:
        spots = find_mirror_spots(as_image(rgb), placed=session.decisions.spots_px)
        marks = ImageOverlay(markers=spot_markers(spots, editable=True))
        return judged_detection(marks, spots.quality.figures, "The spots were placed by hand.")

    return detect_or_refusal(detect)


class LightsStep(ImageStep):
    """Finds the spots. The user can drag each of them."""

    of = LIGHTS
    guide = "guide/calibrate", "4-lights"
    task = "Lay the mirror on the top opening, with all LEDs on and the room dark."
    assembly = "mirror"
    frames, wanted = 16, 1
    advice = "Shorten the exposure until the three spots are small and not saturated."
    figure = "led_sd_mm"

    def detector(self, name: str) -> Detector:
        """Return the detection of the spots, with their positions in an earlier mirror image."""
        session, results = self.session, self.results
        if name and session.decisions.spots_px:
            return partial(placed_spots, session=session)
        expected = None
        lens, top, lights = results.get(LENS), results.get(TOP_POSE), results.get(LIGHTS)
        if lens and top and lights:
            plane, leds_mm = top.pose.plane, lights.leds.led_positions_mm
            expected = mirror_positions_px(lens.camera, plane, leds_mm)
        boards = session.top_pose, session.checkerboard
        return partial(detect_mirror, expected_px=expected, editable=bool(name), boards=boards)

    def moved(self, handle: str, u: float, v: float, radius_px: float) -> None:
        """Move an LED's spot to the spot at this point, or to the point itself."""
        if not self.model.page.shown:
            return
        led, path = int(handle.removeprefix("mirror.")), self._path(self.model.page.shown)
        session = self.session
        self.model.short_jobs.submit(
            BackgroundJob(
                "Analysing the image",
                lambda _progress: spot_near(session.image(path), (u, v)),
                lambda near: self.place_spot(led, near or (u, v)),
            )
        )

    def place_spot(self, led: int, position: PointXY | None) -> None:
        """Set the position of an LED's mirror spot by hand, with undo."""
        put, before = (
            partial(self.project.place_spot, led),
            self.session.decisions.spots_px.get(led),
        )
        self.model.correct("Move the mirror spot", put, position, before, "lights")
