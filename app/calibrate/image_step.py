"""A step that captures images: live detection, captures, and corrections by hand."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from PySide6.QtWidgets import QFileDialog, QWidget

from app.calibrate.detection import Detector, read_raw
from app.calibrate.film_strip import Capture
from app.calibrate.states import OPEN
from app.calibrate.step import Parts, StepPresenter, no_camera
from app.calibrate.step_data import step_of
from app.live.image_checks import Rgb
from app.live.live_detection import Detection, Seen
from app.live.overlay import Overlay, hold_ring
from app.services.jobs import Job
from app.sources.processor import Failure, Outcome
from app.sources.source import Frame
from gelpolight_core.calibration.recipe import Stage
from gelpolight_core.calibration.status import StageState, StageStatus
from gelpolight_core.finding import Finding, Verdict
from gelpolight_core.session.session import Session
from gelpolight_core.translation import tr

# After an automatic capture the technician has this long to arrange the next view.
PAUSE_S = 1.5


def judged_stage(status: StageStatus) -> Finding | None:
    """Return how a stage was judged; None without an up-to-date result."""
    if status.state in (StageState.STALE, StageState.WAITING, StageState.EMPTY):
        return None
    return Finding("stage", status.sentence, verdict=Verdict(status.state.value))


class ImageStep(StepPresenter):
    """A step with images of its own. A step supplies its detection and its judgement of a capture.

    Parameters
    ----------
    parts : Parts
        What all steps share.
    """

    uses_camera = True
    judges_focus = False

    def __init__(self, parts: Parts) -> None:
        super().__init__(parts)
        self._armed: tuple[Any, ...] = ()
        self._paused_until = 0.0
        self._fresh = ""  # a capture whose verdict is still to be shown

    # Supplied by the step

    def detector(self, name: str) -> Detector:
        """Return the detection for a capture, or for the live image if `name` is empty."""
        raise NotImplementedError

    def depends_on(self) -> tuple[Any, ...]:
        """Return what the detection depends on, beside decisions and results."""
        return ()

    def judge(self, path: Path) -> Finding | None:
        """Return how a capture was judged: by default as its stage. None: not yet."""
        return judged_stage(self.model.statuses[self.stage])

    def note(self, name: str) -> str:
        """Return a text about a capture that is shown instead of its verdict; empty by default."""
        return ""

    @property
    def radius_mm(self) -> float | None:
        """Radius of the ball of the next press; None in steps without one."""
        return None

    @property
    def typing(self) -> bool:
        """Whether a value is being typed that the next capture needs."""
        return False

    # What is shown

    @property
    def stage(self) -> str:
        """The stage of the images."""
        return self.step.stages[0]

    def obstacle(self) -> str:
        """Return what is missing or wrong; empty if the step is complete or being computed."""
        state, sentence = self.model.states[self.step.key]
        if state not in OPEN:
            return ""
        if state == StageState.EMPTY.value:
            sentence = tr("Nothing is captured yet")
        text = tr("{title} is not complete: {why}. To skip it for now, choose a step in the list.")
        return text.format(title=self.step.title, why=sentence.rstrip("."))

    def focus(self) -> QWidget:
        """Return the button that the user needs next."""
        panel = self.panel
        if panel.finished:
            return panel.next
        return panel.capture if panel.capture.isEnabled() else panel.more

    def captures(self) -> tuple[Capture, ...]:
        """Return the images of the step with their states."""
        return captures_of(self.model.project.session, self.step.folder, self.judge, note=self.note)

    def enter(self) -> None:
        """Show the live image of the step."""
        # Turning the lens after the lens step makes a new calibration necessary.
        self.area.view.judge_focus(self.judges_focus)
        self.model.live_detection.forget_movement()
        super().enter()
        self.camera_changed()

    def refresh(self) -> None:
        """Update to changed results and corrections, also after undo."""
        super().refresh()
        captures = self.captures()
        self.panel.show_captures(captures)
        fresh = next((one for one in captures if one.path.name == self._fresh), None)
        if fresh is not None and fresh.finding is not None and not self.model.busy_with_images:
            self._fresh = ""
            self.area.show_verdict(fresh)
        self._point_to_captures()
        self.arm()

    def live(self) -> None:
        """Show the live image with the detection in it."""
        super().live()
        self._point_to_captures()
        self.arm(force=True)

    def _point_to_captures(self) -> None:
        """Without a camera, say how to show a capture."""
        there = self.model.live.stream is not None or self.model.shown
        if not there and self.model.project.session.found(self.step.folder):
            self.area.view.image.say(no_camera() + "\n" + tr("Click an image below to show it."))

    def camera_changed(self) -> None:
        """Show the images of another camera, unless a capture is shown.

        If the session's images are not from that camera, show the newest of them instead.
        """
        live = self.model.live
        found = self.model.project.session.found(self.step.folder)
        foreign = self.model.camera_fault(ask=False) or self.model.from_files()
        own = live.stream is not None and not foreign
        if self.model.shown:
            self.panel.capture.setEnabled(live.stream is not None)
        elif found and live.page_shown and not own:
            self.show_capture(found[-1].name)
        else:
            self.live()

    def show_capture(self, name: str) -> None:
        """Show a capture with its detection."""
        self.area.show_capture(name, read_raw(self._path(name)))
        self.model.show(name)
        self.panel.show_live("", ready=True)
        self.arm(force=True)

    def _path(self, name: str) -> Path:
        return self.model.project.session.folder / self.step.folder / name

    # Detection

    def arm(self, *, force: bool = False) -> None:
        """Set the detection that the step needs, based on the present results."""
        project, name = self.model.project, self.model.shown
        armed = (name, self.depends_on(), project.session.decisions, project.results)
        if not force and _same(armed, self._armed):
            return
        self._armed = armed
        foreign = self.model.camera_fault(ask=False)
        self.model.live_detection.set_detector(None if name or foreign else self.detector(""))
        if name:
            self._detect_again(name)

    def _detect_again(self, name: str) -> None:
        """Run the detection on the shown capture; only the newest result is shown."""
        detector, path, armed = self.detector(name), self._path(name), self._armed

        def done(found: Detection) -> None:
            if self._armed is armed:
                self._show(found)

        def failed(sentence: str) -> None:
            if self._armed is armed:
                self.panel.show_live(sentence, ready=False)

        title = tr("Analysing the image")
        self.model.short_jobs.submit(
            Job(title, lambda _progress: detector(read_raw(path)), done, failed)
        )

    def _show(self, found: Detection) -> None:
        self.area.view.set_overlay(found.overlay)
        self.panel.show_live(found.sentence, ready=found.good)

    def _show_seen(self, seen: Seen) -> None:
        """Show what is in the live image, and how long it must still be held."""
        found, held = seen.detection, 0.0
        sentence, changed = found.sentence, self.model.camera_change(self.stage)
        if changed:
            self._show(replace(found, finding=Finding("camera", changed, verdict=Verdict.WARN)))
            return
        if self._captures_itself and found.good and not self._has_its_image:
            if seen.moved:
                held, sentence = seen.held, tr("Hold still: captures by itself.")
            else:
                sentence += " " + tr("Move it for an automatic capture, or click Capture.")
        elif self.panel.finished and found.ready:
            sentence = tr("This step is complete.")
        rings = hold_ring(found.overlay, self.area.view.image.image_size, held)
        self.area.view.set_overlay(replace(found.overlay, rings=rings))
        self.panel.show_live(sentence, ready=found.good or self.panel.finished)

    def detected(self, item: Outcome[Any] | Failure) -> None:
        """Show what was detected in a live image, and capture a good one if that is wanted."""
        if self.model.shown:
            return
        if isinstance(item, Failure):
            self.area.view.set_overlay(Overlay())
            self.panel.show_live(item.sentence, ready=False)
        elif isinstance(item.value, Seen):
            if item.frame.settled:
                self._show_seen(item.value)
            else:
                self.area.view.set_overlay(Overlay())
                self.panel.show_live(tr("The image is changing."), ready=False)
            if self._is_good(item.frame, item.value):
                self.capture_by_itself()

    def _is_good(self, frame: Frame, seen: Seen) -> bool:
        """Return whether the image can be captured automatically: never the same view twice."""
        ready = seen.still and seen.detection.good and frame.settled and seen.moved
        waiting = self.model.busy_with_images or time.monotonic() < self._paused_until
        changed = self.model.camera_change(self.stage)
        return ready and not self._has_its_image and not waiting and not changed

    @property
    def _captures_itself(self) -> bool:
        """Whether a good image is captured automatically now."""
        return self.panel.automatic.isChecked() and not self.model.busy_with_images

    @property
    def _has_its_image(self) -> bool:
        """Whether the step needs one image and has it, and it did not fail."""
        found = self.model.project.session.found(self.step.folder)
        failed = self.model.states[self.step.key][0] == StageState.FAIL.value
        return self.step.wanted == 1 and bool(found) and not failed

    # Images

    def capture(self) -> None:
        """Capture an image; if a capture is shown, return to the live image instead."""
        if self.model.shown:
            self.live()
            return
        self.panel.show_notice("", "pass")
        radius_mm = self.radius_mm
        self.area.show_verdict(None)
        self.model.live_detection.forget_movement()  # before the next automatic capture
        self._paused_until = time.monotonic() + PAUSE_S
        self.arm(force=True)
        self.model.capture(self.stage, frames=self.step.frames, radius_mm=radius_mm)

    def capture_by_itself(self) -> None:
        """Capture the image, if automatic capture is on."""
        if not self.panel.automatic.isChecked():
            return
        if self.typing:  # a partly typed number is not valid
            text = tr("Press Enter after the diameter. Automatic capture waits for it.")
            self.panel.show_notice(text, "warn")
            return
        self.capture()

    def captured(self, name: str) -> None:
        """Show the verdict on a new image as soon as there is one."""
        self._fresh = name
        self.area.view.set_overlay(None)

    def repeat(self, name: str) -> None:
        """Exclude a capture, and show the live image to capture it again."""
        self.exclude(name, True)
        self.live()
        text = tr("{name} is excluded. Capture a new image in its place.")
        self.panel.show_notice(text.format(name=name), "warn")

    def choose_files(self) -> None:
        """Let the user choose image files to import."""
        settings = self.context.settings
        files, _ = QFileDialog.getOpenFileNames(
            self.area,
            tr("Import images"),
            str(settings.folder("images")),
            tr("Images (*.png *.tif *.tiff)"),
        )
        if files:
            settings.keep_folder("images", Path(files[0]).parent)
            self.import_files([Path(file) for file in files])

    def import_files(self, files: list[Path]) -> None:
        """Import image files into the step."""
        self.panel.show_notice("", "pass")
        self.model.import_files(self.stage, files, radius_mm=self.radius_mm)


def plain_step(stage: Stage[Any]) -> type[ImageStep]:
    """Return the step of a stage without a panel of its own: it captures, imports and excludes."""

    class PlainStep(ImageStep):
        """Captures the images of the stage."""

        step = step_of(
            stage,
            stage.task or tr("Capture the images of this stage."),
            "complete",
            frames=16 if stage.one_image else 4,
            wanted=1,
        )

        def detector(self, name: str) -> Detector:
            """Return what accepts every image: the stage judges it."""
            return _accept

    return PlainStep


def _accept(_rgb: Rgb) -> Detection:
    return Detection(Overlay(), Finding("any", tr("The image can be captured.")))


def captures_of(
    session: Session,
    folder: str,
    judge: Callable[[Path], Finding | None],
    *,
    note: Callable[[str], str] = lambda _name: "",
) -> tuple[Capture, ...]:
    """Return all captures of a stage with their states, including the excluded ones.

    Parameters
    ----------
    session : Session
        The session.
    folder : str
        Folder of the stage.
    judge : callable
        Judges an image that is not excluded.
    note : callable, optional
        Text about an image, by its name.
    """
    used = {path.name for path in session.found(folder)}
    return tuple(
        Capture(path, judge(path), note=note(path.name))
        if path.name in used
        else Capture(path, excluded=True)
        for path in session.captured(folder)
    )


def _same(one: tuple[Any, ...], other: tuple[Any, ...]) -> bool:
    """Return whether nothing has changed; results are compared by identity."""
    return bool(other) and one[:-1] == other[:-1] and one[-1] is other[-1]
