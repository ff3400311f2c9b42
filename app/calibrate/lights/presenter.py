"""The lights step: reflections of the three LEDs in a mirror."""

from __future__ import annotations

from functools import partial

from app.calibrate.detection import Detector
from app.calibrate.image_step import ImageStep
from app.calibrate.lights.detector import detect_mirror, placed_spots
from app.calibrate.marks import mirror_positions_px
from app.calibrate.step_data import Step
from app.services.jobs import Job
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.lights.mirror import spot_near
from gelpolight_core.session.decisions import Point
from gelpolight_core.translation import tr

HANDLE = "mirror."


class LightsStep(ImageStep):
    """Finds the spots; the user can drag each to its place."""

    @staticmethod
    def describe() -> Step:
        """Return the data of the step."""
        return Step(
            "lights",
            tr("Lights"),
            (Stage.LIGHTS,),
            tr(
                "Replace the board with the mirror. Switch all three LEDs on and darken the room. "
                "Shorten the exposure until the three spots are small and not saturated."
            ),
            "mirror",
            frames=16,
            wanted=1,
        )

    def detector(self, name: str) -> Detector:
        """Return the detection of the spots, with their positions in an earlier mirror image."""
        session, results = self.model.project.session, self.model.project.results
        if name and session.decisions.spots_px:
            return partial(placed_spots, session=session)
        expected = None
        if results.lens and results.top_pose and results.lights:
            expected = mirror_positions_px(
                results.lens.camera, results.top_pose.plane, results.lights.led_positions_mm
            )
        return partial(detect_mirror, expected_px=expected, editable=bool(name))

    def moved(self, handle: str, u: float, v: float, radius_px: float) -> None:
        """Move an LED's spot to the spot at this point, or to the point itself."""
        if not self.model.shown:
            return
        led, path = int(handle.removeprefix(HANDLE)), self._path(self.model.shown)
        session = self.model.project.session
        self.model.short_jobs.submit(
            Job(
                tr("Analysing the image"),
                lambda _progress: spot_near(session.image(path), (u, v)),
                lambda near: self.place_spot(led, near or (u, v)),
            )
        )

    def place_spot(self, led: int, position: Point | None) -> None:
        """Set the position of an LED's mirror spot by hand; can be undone."""
        project = self.model.project
        act = partial(project.place_spot, led)
        before = project.session.decisions.spots_px.get(led)
        text = tr("Move the mirror spot")
        self.model.correct(text, partial(act, position), partial(act, before), Stage.LIGHTS)
