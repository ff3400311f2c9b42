"""A step that captures images: live detection, captures, and corrections by hand."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from PySide6.QtWidgets import QWidget

from app.live.live_detection import Detection, HeldDetection
from app.live.overlay import ImageOverlay, hold_ring
from app.program.file_dialogs import ask_several, image_patterns
from app.program.jobs import BackgroundJob
from app.sources.latest import Done
from app.sources.source import SourceFrame
from gelpolight_core.base.arrays import PixelArray
from gelpolight_core.base.finding import Finding, Verdict
from gelpolight_core.calibration.recipe import Stage
from gelpolight_core.calibration.stage_status import StageState, StageStatus

from .detection_marks import Detector, detect_or_refusal, read_raw
from .page_state import Capture
from .step import NO_CAMERA, Step

# After an automatic capture the technician has this long to arrange the next view.
PAUSE_S = 1.5


def judged_stage(status: StageStatus) -> Finding | None:
    """Return the judgement of a stage, or None without an up-to-date result."""
    if status.state in (StageState.STALE, StageState.WAITING, StageState.EMPTY):
        return None
    return Finding("stage", status.sentence, verdict=Verdict(status.state.value))


class ImageStep(Step):
    """A step with images of its own. A subclass supplies detection and judgement of a capture."""

    judges: tuple[str, ...] = ("dark",)
    """What is judged of its live images, see `LiveView.judge`."""
    _armed: tuple[Any, ...] = ()
    _paused_until = 0.0
    _fresh = ""
    """A capture whose verdict is still to be shown."""

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
        """Return a text about a capture that replaces its verdict, empty by default."""
        return ""

    @property
    def radius_mm(self) -> float | None:
        """Radius of the ball of the next press, or None in steps without one."""
        return None

    @property
    def typing(self) -> bool:
        """Whether a value is being typed that the next capture needs."""
        return False

    # What is shown

    @property
    def stage(self) -> str:
        """The stage of the images."""
        return self.stages[0]

    def obstacle(self) -> str:
        """Return what is missing or wrong. Empty: the step is complete or being computed."""
        state, sentence = self.model.page.states[self.key]
        if not self.needs_user(state):
            return ""
        if state == StageState.EMPTY.value:
            sentence = "Nothing is captured yet"
        reason = f"{self.title} is not complete: {sentence.rstrip('.')}."
        return f"{reason} To skip it for now, choose a step in the list."

    def focus(self) -> QWidget:
        """Return the button that the user needs next."""
        if self.model.page.finished:
            return self.panel.next
        return self.panel.capture if self.panel.capture.isEnabled() else self.panel.more

    def captures(self) -> tuple[Capture, ...]:
        """Return all images of the step with their states, including the excluded ones."""
        used_names = {path.name for path in self.session.found(self.folder)}
        return tuple(
            Capture(path, self.judge(path), note=self.note(path.name))
            if path.name in used_names
            else Capture(path, excluded=True)
            for path in self.session.captured(self.folder)
        )

    def enter(self) -> None:
        """Show the live image of the step."""
        # Turning the lens after the lens step makes a new calibration necessary.
        self.area.view.judge(*self.judges)
        self.model.live_detection.forget_movement()
        super().enter()
        self.camera_changed()

    def refresh(self) -> None:
        """Update to changed results and corrections, also after undo."""
        fresh = next((c for c in self.model.page.captures if c.path.name == self._fresh), None)
        if fresh is not None and fresh.finding is not None and not self.model.busy_with_images:
            self._fresh = ""
            self.area.verdict.show_capture(fresh)
        self._point_to_captures()
        self.arm()

    def live(self) -> None:
        """Show the live image with the detection in it."""
        super().live()
        self._point_to_captures()
        self.arm(force=True)

    def _point_to_captures(self) -> None:
        """Without a camera, say how to show a capture."""
        has_image = self.model.live.stream is not None or self.model.page.shown
        if not has_image and self.session.found(self.folder):
            self.area.view.image.show_message(f"{NO_CAMERA}\nClick an image below to show it.")

    def camera_changed(self) -> None:
        """Show the images of another camera, unless a capture is shown.

        If the session's images are not from that camera, show the newest of them instead.
        """
        live = self.model.live
        images = self.session.found(self.folder)
        is_foreign = self.model.camera.fault(ask=False) or self.model.camera.from_files()
        is_usable = live.stream is not None and not is_foreign
        if self.model.page.shown:
            return
        if images and live.page_shown and not is_usable:
            self.show_capture(images[-1].name)
        else:
            self.live()

    def show_capture(self, name: str) -> None:
        """Show a capture with its detection."""
        self.commit()
        self.area.show_capture(name, read_raw(self._path(name)))
        self.model.update_page(shown=name, live=("", "pass"))
        self.arm(force=True)

    def _path(self, name: str) -> Path:
        return self.session.folder / self.folder / name

    # Detection

    def arm(self, *, force: bool = False) -> None:
        """Set the detection that the step needs, based on the present results."""
        project, name = self.project, self.model.page.shown
        armed = (name, self.depends_on(), project.session.decisions, project.results)
        if not force and _same(armed, self._armed):
            return
        self._armed = armed
        foreign = self.model.camera.fault(ask=False)
        self.model.live_detection.set_detector(None if name or foreign else self.detector(""))
        if name:
            self._detect_again(name)

    def _detect_again(self, name: str) -> None:
        """Run the detection on the shown capture. Only the newest result is shown."""
        detector, path, armed = self.detector(name), self._path(name), self._armed

        def work(_progress: object) -> Detection:
            return detect_or_refusal(lambda: detector(read_raw(path)))

        def done(detection: Detection) -> None:
            if self._armed is armed:
                self._show(detection)

        self.model.short_jobs.submit(BackgroundJob("Analysing the image", work, done))

    def _show(self, detection: Detection) -> None:
        self.area.view.set_overlay(detection.overlay)
        self.model.show_live(detection.sentence, ready=detection.good)

    def _show_seen(self, current: HeldDetection) -> None:
        """Show the detection in the live image, and for how long it must still be held."""
        detection, held_share = current.detection, 0.0
        sentence, change = detection.sentence, self.model.camera.change(self.stage)
        if change:
            self._show(replace(detection, finding=Finding("camera", change, verdict=Verdict.WARN)))
            return
        overlay, finished = detection.overlay, self.model.page.finished
        is_automatic = self.panel.automatic.isChecked() and not self.model.busy_with_images
        captures = is_automatic and detection.good and not self._has_its_image
        if captures and current.moved:
            held_share, sentence = current.held, "Hold still: captures by itself."
        elif finished:
            sentence = "This step is complete."
        elif captures:
            sentence += " Move it for an automatic capture, or click Capture."
        if finished and not detection.ready:
            overlay = ImageOverlay()  # no other view is expected
        rings = hold_ring(overlay, self.area.view.image.image_size, held_share)
        self.area.view.set_overlay(replace(overlay, rings=rings))
        waits = not detection.ready and not (self.count() and not self.model.jobs.busy)
        self.model.show_live(sentence, ready=detection.good or finished, waits=waits)

    def detected(self, done: Done[SourceFrame, HeldDetection | None]) -> None:
        """Show what was detected in a live image, and capture a good one in automatic mode."""
        if self.model.page.shown:
            return
        if done.failure:
            self.area.view.set_overlay(ImageOverlay())
            self.model.show_live(done.failure, ready=False)
        elif done.result is not None:
            if done.request.settled:
                self._show_seen(done.result)
            else:
                self.area.view.set_overlay(ImageOverlay())
                self.model.show_live("The image is changing.", ready=False, waits=True)
            if self._is_good(done.request, done.result):
                self.capture_by_itself()

    def _is_good(self, frame: SourceFrame, current: HeldDetection) -> bool:
        """Return whether the image can be captured automatically: never the same view twice."""
        ready = current.still and current.detection.good and frame.settled and current.moved
        waiting = self.model.busy_with_images or time.monotonic() < self._paused_until
        changed = self.model.camera.change(self.stage)
        return ready and not self._has_its_image and not waiting and not changed

    @property
    def _has_its_image(self) -> bool:
        """Whether the step needs one image and has it, and it did not fail."""
        images = self.session.found(self.folder)
        has_failed = self.model.page.states[self.key][0] == StageState.FAIL.value
        return self.wanted == 1 and bool(images) and not has_failed

    # Images

    def capture(self) -> None:
        """Capture an image, or return from a shown capture to the live image."""
        if self.model.page.shown:
            self.live()
            return
        self.commit()
        self.model.show_notice("", "pass")
        self.area.verdict.show_capture(None)
        self.model.live_detection.forget_movement()  # before the next automatic capture
        self._paused_until = time.monotonic() + PAUSE_S
        self.arm(force=True)
        self.model.capture(self.stage, frames=self.frames, radius_mm=self.radius_mm)

    def capture_by_itself(self) -> None:
        """Capture the image, if automatic capture is on."""
        if not self.panel.automatic.isChecked():
            return
        if self.typing:  # a partly typed number is not valid
            text = "Press Enter after the diameter. Automatic capture waits for it."
            self.model.show_notice(text, "warn")
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
        text = f"{name} is excluded. Capture a new image in its place."
        self.model.show_notice(text, "warn")

    def choose_files(self) -> None:
        """Let the user choose image files to import."""
        title, patterns = "Import images", image_patterns()
        if files := ask_several(self.area, self.context.settings, "images", title, patterns):
            self.import_files(files)

    def import_files(self, files: Sequence[Path]) -> None:
        """Import image files into the step."""
        self.commit()
        self.model.show_notice("", "pass")
        self.model.import_files(self.stage, files, radius_mm=self.radius_mm)


def plain_step(stage: Stage[Any]) -> type[ImageStep]:
    """Return the step of a stage without a panel of its own: it captures, imports and excludes."""

    class PlainStep(ImageStep):
        """Captures the images of the stage."""

        of = stage
        task = stage.task or "Capture the images of this stage."
        frames, wanted = 16 if stage.one_image else 4, 1

        def detector(self, name: str) -> Detector:
            """Return what accepts every image: the stage judges it."""
            return _accept

    return PlainStep


def _accept(_rgb: PixelArray) -> Detection:
    return Detection(ImageOverlay(), Finding("any", "The image can be captured."))


def _same(before: tuple[Any, ...], after: tuple[Any, ...]) -> bool:
    """Return whether nothing has changed. Results are compared by identity."""
    return bool(after) and before[:-1] == after[:-1] and before[-1] is after[-1]
