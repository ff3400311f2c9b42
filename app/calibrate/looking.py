"""What the picture of a step shows: the live picture with its detection, or a capture."""

from __future__ import annotations

import time
from typing import Any

from PySide6.QtCore import QObject, Signal

from app.calibrate.controller import CalibrationController
from app.calibrate.detection import Detection
from app.calibrate.look import look_for, read_raw
from app.calibrate.pictures import Pictures
from app.calibrate.step_panel import StepPanel
from app.calibrate.steps import Step
from app.calibrate.watching import Seen
from app.live.overlay import Overlay
from app.shell.jobs import Job
from app.sources.processor import Failure, Outcome
from app.sources.source import Frame
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.session.decisions import PlacedCircle
from gelpolight_core.translation import tr

# After a capture by itself the technician has this long to arrange the next view.
PAUSE_S = 1.5
USUAL_RADIUS_MM = 3.0


class Looking(QObject):
    """Shows pictures with what was found in them, and what a person puts right there.

    Attributes
    ----------
    step : Step
        Which is open.
    name : str
        The capture that is looked at; empty for the live picture.

    Signals
    -------
    good()
        The live picture is still, good and another one than that of the last capture.
    looked()
        Another capture, or the live picture again.
    """

    good = Signal()
    looked = Signal()

    def __init__(
        self,
        controller: CalibrationController,
        pictures: Pictures,
        panel: StepPanel,
        step: Step,
    ) -> None:
        super().__init__(pictures)
        self._controller, self._pictures, self._panel = controller, pictures, panel
        self.step, self.name = step, ""
        self._armed: tuple[Any, ...] = ()
        self._radius_mm: float | None = None
        self._paused_until = 0.0
        controller.watching.detected.connect(self._on_detected)
        panel.radius.valueChanged.connect(self._on_radius)
        pictures.view.moved.connect(self._on_moved)

    @property
    def radius_mm(self) -> float | None:
        """Radius of the ball of the next press; None in other steps."""
        if self.step.stage is not Stage.BALLS:
            return None
        self._panel.radius.interpretText()  # what is typed counts, Enter or not
        return self._panel.radius.value()

    @property
    def has_pictures(self) -> bool:
        """Whether the step has pictures of its own to look for."""
        return self.step.stage is not None and self.step.key != "refraction"

    def take_step(self, step: Step) -> None:
        """Show another step's live picture."""
        self.step = step
        # Whoever turns the lens after its step has to begin anew.
        self._pictures.view.judge_focus(step.stage is Stage.LENS)
        self._controller.watching.forget_movement()
        self.live()

    def live(self) -> None:
        """Show the live picture again."""
        self._panel.radius.interpretText()  # what is typed is of the picture that was looked at
        self.name = ""
        self._pictures.strip.choose("")
        self._pictures.show_looked_at("")
        self._pictures.view.set_overlay(None)
        self._show_stream()
        self._show_radius()
        self.arm(anew=True)
        self.looked.emit()

    def _show_stream(self) -> None:
        stream = self._controller.watching.stream
        self._pictures.view.set_stream(stream)
        if stream is None:
            said = tr("No camera: choose one in the bar above, or import pictures.")
            self._panel.show_live(said if self.has_pictures else "", ready=False)
            if self.has_pictures and self._controller.project.session.found(self.step.folder):
                said += "\n" + tr("Click a picture below to look at it.")
            self._pictures.view.say(said)
        else:
            self._pictures.view.say(tr("Waiting for the camera's first picture."))
            self._panel.show_live("", ready=True)
        self._panel.capture.setEnabled(stream is not None)

    def camera_changed(self) -> None:
        """Show another camera's pictures, unless a capture is looked at."""
        if self.name:
            self._panel.capture.setEnabled(self._controller.watching.stream is not None)
        else:
            self.live()

    def arm(self, *, anew: bool = False) -> None:
        """Let the detection look for what the step needs, with the results of now."""
        project = self._controller.project
        views = self._controller.lens_views()
        radius_mm = self._panel.radius.value()
        decisions = project.session.decisions
        armed = (self.step, self.name, radius_mm, frozenset(views), decisions, project.results)
        if not anew and _same(armed, self._armed):
            return
        self._armed = armed
        looker = None
        if self.has_pictures and not self.name:
            looker = look_for(self.step, project, radius_mm=radius_mm, views=views)
        self._controller.watching.look_with(looker)
        if self.name:
            self._look_again()

    def at(self, name: str) -> None:
        """Show a capture with what was found in it.

        Raises
        ------
        InputError
            If it cannot be read.
        """
        raw = read_raw(self._path(name))
        self._panel.radius.interpretText()  # what is typed is not of this picture
        self.name = name
        view = self._pictures.view
        view.set_stream(None)
        view.show_picture(raw)
        view.set_overlay(None)
        self._panel.show_live("", ready=True)
        self._pictures.strip.choose(name)
        self._pictures.show_looked_at(name)
        self._show_radius()
        self.arm(anew=True)
        self.looked.emit()

    def _path(self, name: str) -> Any:
        return self._controller.project.session.folder / self.step.folder / name

    def _look_again(self) -> None:
        """Look for the step's object in the capture; the newest answer is shown."""
        if not self.has_pictures:
            return
        name, controller, armed = self.name, self._controller, self._armed
        looker = look_for(
            self.step,
            controller.project,
            radius_mm=self._panel.radius.value(),
            views=controller.lens_views(),
            name=name,
        )
        path = self._path(name)

        def done(found: Detection) -> None:
            if self._armed is armed:
                self._show(found)

        def failed(sentence: str) -> None:
            if self._armed is armed:
                self._panel.show_live(sentence, ready=False)

        title = tr("Looking at the picture")
        controller.desk.submit(Job(title, lambda _tell: looker(read_raw(path)), done, failed))

    def _show(self, found: Detection) -> None:
        self._pictures.view.set_overlay(found.overlay)
        self._panel.show_live(found.sentence, ready=found.ready and not found.warns)

    def _on_detected(self, item: Any) -> None:
        if self.name:
            return
        if isinstance(item, Failure):
            self._pictures.view.set_overlay(Overlay())
            self._panel.show_live(item.sentence, ready=False)
        elif isinstance(item, Outcome) and isinstance(item.value, Seen):
            if not item.frame.settled:
                self._pictures.view.set_overlay(Overlay())
                self._panel.show_live(tr("The picture is changing."), ready=False)
            else:
                self._show(item.value.detection)
            self._judge(item.frame, item.value)

    def _judge(self, frame: Frame, seen: Seen) -> None:
        """Say when the picture may be captured by itself: never the same view twice."""
        folder = self.step.folder
        enough = self.step.wanted == 1 and self._controller.project.session.found(folder)
        ready = seen.still and seen.detection.ready and frame.settled and seen.moved
        waiting = self._controller.busy_with_pictures or time.monotonic() < self._paused_until
        if ready and not enough and not waiting:
            self.good.emit()

    def captured(self) -> None:
        """Wait for another view before the next capture by itself, however this one came."""
        self._controller.watching.forget_movement()
        self._paused_until = time.monotonic() + PAUSE_S
        self.arm(anew=True)

    # What a person puts right

    def _on_moved(self, handle: str, u: float, v: float, radius_px: float) -> None:
        if not self.name:
            return
        if handle.startswith("mirror."):
            led = int(handle.removeprefix("mirror."))
            self._controller.place_spot_near(led, (u, v), self._path(self.name))
        elif handle == "ball":
            self._controller.place_ball(self.name, PlacedCircle(u, v, radius_px))

    def set_next_radius(self, radius_mm: float) -> None:
        """State the radius of the next press."""
        self._radius_mm = radius_mm
        self._show_radius()

    def _show_radius(self) -> None:
        if self.step.stage is not Stage.BALLS:
            return
        session = self._controller.project.session
        usual = session.ball_default_radius_mm or USUAL_RADIUS_MM
        value = self._radius_mm or usual
        if self.name:
            value = session.ball_radii_mm.get(self.name, usual)
        self._panel.radius.blockSignals(True)
        self._panel.radius.setValue(value)
        self._panel.radius.blockSignals(False)

    def _on_radius(self, radius_mm: float) -> None:
        if self.name:
            self._controller.set_ball_radius(self.name, radius_mm)
        else:
            self._radius_mm = radius_mm
            self.arm()

    def refresh(self) -> None:
        """Follow what has changed: results, views, corrections and their undoing."""
        if not self._panel.types_radius:
            self._show_radius()
        self.arm()


def _same(one: tuple[Any, ...], other: tuple[Any, ...]) -> bool:
    """Whether nothing has changed; results are compared by being the same object."""
    return bool(other) and one[:-1] == other[:-1] and one[-1] is other[-1]
