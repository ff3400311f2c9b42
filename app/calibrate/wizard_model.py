"""The observable model of the wizard: session, history, work, state of the page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QUndoStack
from PySide6.QtWidgets import QWidget

from app.live.live_detection import LiveDetection
from app.live.live_session import LiveSession
from app.program.calibration_entries import read_entry
from app.program.calibration_status import put_into_use
from app.program.context import AppContext
from app.program.jobs import BackgroundJob, JobQueue
from app.widgets.actions import UndoStep
from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.project import CalibrationProject

from .page_state import PageState
from .session_camera import SessionCamera


class WizardModel(QObject):
    """Shared model of the steps of one wizard, without widgets.

    Captures are written by a separate thread, so that they never wait for a computation.

    Attributes
    ----------
    live : LiveSession
        The live images.
    camera : SessionCamera
        The camera of the session, compared with the selected one.
    live_detection : LiveDetection
        The detection of the open step on its images.
    undo : QUndoStack
        Every capture and manual correction, in one history.
    jobs, short_jobs : JobQueue
        The computations, and the short jobs that run next to them.
    statuses : dict of str to StageStatus
        Status of every stage, as the page shows it.
    running : str or None
        The stage that is being computed.
    saved_path : Path or None
        The newest saved calibration of this session.
    page : PageState
        State of the page.
    stopped : bool
        Whether the user has stopped the computations, so that none starts by itself.

    Signals
    -------
    changed()
        Captures, decisions or results changed.
    page_changed(object)
        The page shows something else; with its state before.
    captured(str, str)
        Key of the stage and name of a new image.
    photographed()
        The camera has made a new image; not sent for imported images.
    refused(str)
        An error message for the user.
    step_requested(str)
        Key of a step to go to.
    """

    changed = Signal()
    page_changed = Signal(object)
    captured = Signal(str, str)
    photographed = Signal()
    refused = Signal(str)
    step_requested = Signal(str)

    def __init__(
        self, project: CalibrationProject, *, context: AppContext, window: QWidget
    ) -> None:
        super().__init__(window)
        self.project, self.context, self._window = project, context, window
        self.undo = QUndoStack(self)
        self.live = LiveSession(context=context, name="detection", keeps_seen=True, parent=self)
        self.live.use(False)  # until a step needs images
        self.live_detection = LiveDetection(self.live)
        self.jobs, self.short_jobs = JobQueue("computing", self), JobQueue("short jobs", self)
        for jobs in (self.jobs, self.short_jobs):
            jobs.refused.connect(self.refused)
        self.camera = SessionCamera(project, self.live, context=context, window=window)
        self.saved_path: Path | None = None
        self._saved_inputs = ""
        self.page = PageState()
        self.running: str | None = None
        self.stopped = False
        self.statuses = project.statuses()

    @property
    def busy_with_images(self) -> bool:
        """Whether an image is being captured or saved."""
        return self.live.capturing or self.short_jobs.busy

    # What the page shows

    def show_page(self, page: PageState) -> None:
        """Show another state of the page."""
        before, self.page = self.page, page
        self.page_changed.emit(before)

    def update_page(self, **changes: Any) -> None:
        """Replace some fields of what the page shows."""
        self.show_page(replace(self.page, **changes))

    def show_notice(self, sentence: str, role: str) -> None:
        """Show the result of the last action. An empty text: nothing to read."""
        self.update_page(notice=(sentence, role))

    def show_live(self, sentence: str, *, ready: bool, waits: bool = False) -> None:
        """Show the content of the live image.

        Parameters
        ----------
        sentence : str
            What it shows.
        ready : bool
            Whether it can be captured.
        waits : bool, optional
            Whether the step has no image yet, so that what is missing is no mistake.
        """
        self.update_page(live=(sentence, "pass" if ready else "muted" if waits else "warn"))

    @property
    def saved(self) -> str:
        """Name of the saved calibration, if it still exists and belongs to the present captures."""
        path, inputs = self.saved_path, self._saved_inputs
        return path.stem if path and path.exists() and inputs == self.project.all_inputs else ""

    def use_calibration(self, path: Path) -> None:
        """Remember the saved calibration of this session."""
        self.saved_path, summary = path, read_entry(path).summary
        self._saved_inputs = "" if summary is None else summary.inputs
        self.changed.emit()

    @property
    def saved_line(self) -> str:
        """Where the present captures are saved, and whether that is in use. Empty: not saved."""
        in_use = self.context.workspace.in_use == self.saved_path
        return self.saved and f"Saved as {self.saved}, and {'in use' if in_use else 'not in use'}."

    def keep(self, path: Path) -> None:
        """Show a new calibration, and use it unless it failed. A button returns to the former."""
        context, before = self.context, self.context.workspace.in_use
        failed = read_entry(path).failed
        if not failed:
            with context.toasts.errors():
                context.workspace.use(path)
        self.use_calibration(path)
        context.requests.calibrations_changed.emit()
        draft = f"Saved as a draft, {path.stem}, and not in use."
        self.show_notice(draft if failed else "", "fail")
        if before is not None and not failed:
            undo = partial(put_into_use, before, self._window, context=context)
            context.toasts.show(self.saved_line, actions=(("Use the previous one", undo),))

    # Images

    def capture(self, stage: str, *, frames: int, radius_mm: float | None = None) -> None:
        """Capture an image for a stage, averaged over frames, of a ball with its radius.

        The image is on disk when :attr:`captured` is sent.
        """
        if fault := self.camera.fault():
            self.refused.emit(fault)
            return

        def keep(frames: list[Any]) -> None:
            add = partial(self.project.add_capture, stage, frames, radius_mm=radius_mm)
            self._save("Saving the image", stage, lambda: (add(),), by_camera=True)

        # A toast, not the page: the user has already left the step.
        aborted = partial(self.context.toasts.show, verdict="fail")
        still_s = self.live_detection.still_s
        self.live.capture(frames, keep, self.refused.emit, aborted=aborted, still_s=still_s)

    def import_files(
        self, stage: str, files: Sequence[Path], *, radius_mm: float | None = None
    ) -> None:
        """Copy image files into a stage: all of them, or none if one is not valid."""
        add = partial(self.project.import_files, stage, files, radius_mm=radius_mm)
        self._save("Importing images", stage, add)

    def _save(
        self, title: str, stage: str, add: Callable[[], tuple[str, ...]], *, by_camera: bool = False
    ) -> None:
        saved = partial(self._on_saved, stage, by_camera=by_camera)
        self.short_jobs.submit(BackgroundJob(title, lambda _progress: add(), saved, must=True))

    def _on_saved(self, stage: str, names: tuple[str, ...], *, by_camera: bool) -> None:
        text = f"Add {names[0]}" if len(names) == 1 else f"Import {len(names)} images"

        def put(present: bool) -> None:
            (self.project.redo_capture if present else self.project.undo_capture)(stage, names)

        self.correct(text, put, True, False, stage, is_done=True)
        self.changed.emit()
        for name in names:
            self.captured.emit(stage, name)
        if by_camera:
            try:
                self.camera.note_image(stage)
            except InputError as error:
                self.refused.emit(str(error))
            self.photographed.emit()
        self.compute(stage)

    # Manual corrections

    def exclude(self, stage: str, name: str, excluded: bool) -> None:
        """Exclude an image, or include it again, with undo."""
        text = f"Exclude {name}" if excluded else f"Include {name}"
        put = partial(self.project.exclude, stage, name)
        self.correct(text, put, excluded, not excluded, stage)

    def set_ball_diameter(self, name: str, diameter_mm: float) -> None:
        """Set the diameter of the ball in one image, with undo."""
        before_mm, radius_mm = self.project.session.ball_radii_mm.get(name), 0.5 * diameter_mm
        if before_mm != radius_mm:
            put = partial(self.project.set_ball_radius, name)
            text = f"Diameter of {name}: {diameter_mm:g} mm"
            self.correct(text, put, radius_mm, before_mm, "balls")

    def correct(
        self,
        text: str,
        put: Callable[[Any], None],
        value: Any,
        before: Any,
        stage: str | None,
        *,
        is_done: bool = False,
    ) -> None:
        """Run a command that can be undone, then compute the stage that it affects.

        Parameters
        ----------
        text : str
            Text in the history.
        put : callable
            Writes a value to disk before it returns; raises InputError on failure, without effect.
        value, before
            The new value, and the one that undo writes.
        stage : str or None
            Key of the stage to compute afterwards, with all that it depends on; None: all stages.
        is_done : bool, optional
            Whether the change is already done, as for a capture.
        """

        def run(value: Any) -> bool:
            try:
                put(value)
            except InputError as error:
                self.refused.emit(str(error))
                return False
            finally:
                self.changed.emit()
                self.compute(stage)
            return True

        first = iter((is_done,))
        step = UndoStep(text, lambda: next(first, False) or run(value), partial(run, before))
        self.undo.push(step)

    # Background work

    def compute(self, upto: str | None = None) -> None:
        """Compute the outdated stages, up to one stage or all of them."""

        def work(progress: Callable[[float], None]) -> None:
            while stale := self.project.stale(upto=upto):
                progress(0.0)
                self.running = stale[0]
                try:
                    self.project.compute(stale[0], progress)
                finally:
                    self.running = None

        self.stopped = False
        if self.project.stale(upto=upto):
            self.jobs.submit(BackgroundJob("Computing", work, lambda _nothing: self.changed.emit()))
            self.changed.emit()

    def stop(self) -> None:
        """Stop the computations until the user asks for one."""
        self.jobs.cancel()
        self.stopped = True

    def close(self) -> None:
        """Write captured images, stop all work, and release the camera."""
        self.live.finish()
        self.short_jobs.close()
        self.jobs.close()
        self.undo.clear()
