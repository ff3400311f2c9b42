"""The observable model of the wizard: session, history, work, and what is shown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QUndoCommand, QUndoStack

from app.calibrate.states import StepState
from app.context.context import AppContext
from app.live.live_detection import LiveDetection
from app.live.session import LiveSession
from app.services.jobs import Job, Jobs
from gelpolight_core.calibration.project import Project
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr


class Correction(QUndoCommand):
    """One correction and its reverse; each changes only the data that it is about.

    A command that cannot be written to disk has no effect and leaves the history.

    Parameters
    ----------
    text : str
        Text in the history list.
    act, revert : callable
        Written to disk before they return; raise InputError on failure.
    done : callable
        Called after either of them.
    refused : callable
        Called with the reason when the command failed.
    is_done : bool, optional
        Whether the change is already done when the command enters the history, as for a capture.
    """

    def __init__(
        self,
        text: str,
        act: Callable[[], None],
        revert: Callable[[], None],
        *,
        done: Callable[[], None],
        refused: Callable[[str], object],
        is_done: bool = False,
    ) -> None:
        super().__init__(text)
        self._is_done = is_done
        self._act, self._revert = act, revert
        self._done, self._refused = done, refused

    def redo(self) -> None:
        """Apply the correction."""
        if self._is_done:
            self._is_done = False
            return
        self._run(self._act)

    def undo(self) -> None:
        """Undo the correction."""
        self._run(self._revert)

    def _run(self, change: Callable[[], None]) -> None:
        try:
            change()
        except InputError as error:
            self.setObsolete(True)
            self._refused(str(error))
        self._done()


class WizardModel(QObject):
    """What the steps of one wizard share; it has no widget of its own.

    Captures are written by a separate thread, so that they never wait for a computation.

    Attributes
    ----------
    live : LiveSession
        The camera.
    live_detection : LiveDetection
        The detection of the open step on its images.
    undo : QUndoStack
        Every capture and manual correction, in one history.
    jobs, short_jobs : Jobs
        The computations, and the short jobs that run next to them.
    shown : str
        Name of the shown capture; empty for the live image.
    statuses : dict of str to StageStatus
        Status of every stage, as of the last :meth:`update`.
    states : dict of str to (state, message)
        State of every step by its key, as the list of steps shows it.

    Signals
    -------
    changed()
        Captures, decisions or results changed.
    shown_changed()
        Another capture, or the live image, is shown.
    captured(str, str)
        Key of the stage and name of a new image.
    photographed(str)
        Stage of a new image from the camera; not sent for imported images.
    progressed(str, float)
        Title of the running computation (empty: none) and the share that is done.
    refused(str)
        An error message for the user.
    capture_aborted(str)
        An error message: the camera was released during a capture.
    saved_as(str)
        Path of a calibration that was just saved.
    """

    changed = Signal()
    shown_changed = Signal()
    captured = Signal(str, str)
    photographed = Signal(str)
    progressed = Signal(str, float)
    refused = Signal(str)
    capture_aborted = Signal(str)
    saved_as = Signal(str)

    def __init__(self, project: Project, *, context: AppContext, parent: QObject) -> None:
        super().__init__(parent)
        self.project = project
        self.undo = QUndoStack(self)
        self.live = LiveSession(context=context, name="detection", parent=self)
        self.live.use(False)  # until a step needs images
        self.live_detection = LiveDetection(self.live)
        self.jobs, self.short_jobs = Jobs("computing", self), Jobs("short jobs", self)
        self.jobs.progressed.connect(self.progressed)
        for jobs in (self.jobs, self.short_jobs):
            jobs.refused.connect(self.refused)
        # Returns why the present camera must not be used for this session; the session camera sets
        # it.
        self.camera_fault: Callable[..., str] = lambda ask=True: ""
        # Returns whether the images are from files, and none from the present camera.
        self.from_files: Callable[[], bool] = lambda: False
        # Returns what was changed on it since the images with which those of a stage are compared.
        self.camera_change: Callable[[str], str] = lambda stage: ""
        self.shown = ""
        self._saved = self._saved_inputs = ""
        self.states: dict[str, StepState] = {}
        self._running: str | None = None
        self.update()

    @property
    def busy(self) -> bool:
        """Whether a capture, a save, a detection or a computation is in progress."""
        return self.live.capturing or self.short_jobs.busy or self.jobs.busy

    @property
    def busy_with_images(self) -> bool:
        """Whether an image is being captured or saved."""
        return self.live.capturing or self.short_jobs.busy

    def update(self) -> None:
        """Look at the files again and judge every stage."""
        self.statuses = self.project.statuses()

    @property
    def saved(self) -> str:
        """Name of the saved calibration, if it belongs to the present captures."""
        return self._saved if self._saved_inputs == self.project.all_inputs else ""

    def use_saved(self, name: str, inputs: str) -> None:
        """Remember a saved calibration and the text of its inputs."""
        self._saved, self._saved_inputs = name, inputs

    # Images

    def show(self, name: str) -> None:
        """Show a capture by its name, or the live image."""
        self.shown = name
        self.shown_changed.emit()

    def capture(self, stage: str, *, frames: int, radius_mm: float | None = None) -> None:
        """Capture an image for a stage, averaged over frames; for a ball, with its radius.

        The image is on disk when :attr:`captured` is sent.
        """
        fault = self.camera_fault()
        if fault:
            self.refused.emit(fault)
            return

        def keep(frames: list[Any]) -> None:
            def work(_progress: Callable[[float], None]) -> tuple[str, ...]:
                return (self.project.add_capture(stage, frames, radius_mm=radius_mm),)

            saved = partial(self._on_saved, stage, by_camera=True)
            self.short_jobs.submit(Job(tr("Saving the image"), work, saved, must=True))

        self.live.capture(frames, keep, self.refused.emit, aborted=self.capture_aborted.emit)

    def import_files(
        self, stage: str, files: Sequence[Path], *, radius_mm: float | None = None
    ) -> None:
        """Copy image files into a stage: all of them, or none if one is not valid."""

        def work(_progress: Callable[[float], None]) -> tuple[str, ...]:
            return self.project.import_files(stage, files, radius_mm=radius_mm)

        saved = partial(self._on_saved, stage)
        self.short_jobs.submit(Job(tr("Importing images"), work, saved, must=True))

    def _on_saved(self, stage: str, names: tuple[str, ...], *, by_camera: bool = False) -> None:
        text = tr("Import {n} images").format(n=len(names))
        if len(names) == 1:
            text = tr("Add {name}").format(name=names[0])
        restore = partial(self.project.take_again, stage, names)
        revert = partial(self.project.take_back, stage, names)
        self.undo.push(self._command(text, restore, revert, stage, is_done=True))
        self.changed.emit()
        for name in names:
            self.captured.emit(stage, name)
        if by_camera:
            self.photographed.emit(stage)
        self.compute(stage)

    # Manual corrections

    def exclude(self, stage: str, name: str, excluded: bool) -> None:
        """Exclude an image, or include it again; can be undone."""
        text = tr("Exclude {name}") if excluded else tr("Include {name}")
        act = partial(self.project.exclude, stage, name)
        self.correct(text.format(name=name), partial(act, excluded), partial(act, not excluded),
                     stage)  # fmt: skip

    def set_ball_diameter(self, name: str, diameter_mm: float) -> None:
        """Set the diameter of the ball in one image; can be undone."""
        act = partial(self.project.set_ball_radius, name)
        before = self.project.session.ball_radii_mm.get(name)
        text = tr("Diameter of {name}: {d:g} mm").format(name=name, d=diameter_mm)
        self.correct(text, partial(act, 0.5 * diameter_mm), partial(act, before), "balls")

    def correct(
        self,
        text: str,
        act: Callable[[], None],
        revert: Callable[[], None],
        stage: str | None,
    ) -> None:
        """Run a command that can be undone, then compute the stage that it affects.

        Parameters
        ----------
        text : str
            Text in the history.
        act, revert : callable
            Written to disk before they return; raise InputError on failure.
        stage : str or None
            Key of the stage to compute afterwards, with all that it depends on; None: all stages.
        """
        self.undo.push(self._command(text, act, revert, stage))

    def _command(
        self,
        text: str,
        act: Callable[[], None],
        revert: Callable[[], None],
        stage: str | None,
        *,
        is_done: bool = False,
    ) -> Correction:
        def done() -> None:
            self.changed.emit()
            self.compute(stage)

        refused = self.refused.emit
        return Correction(text, act, revert, done=done, refused=refused, is_done=is_done)

    def reload(self) -> None:
        """Read the session files again and start a new history.

        Raises
        ------
        InputError
            If the files cannot be used; then nothing changes.
        """
        self.project.reload()
        self.undo.clear()
        self.changed.emit()
        self.compute()

    # Background work

    @property
    def running(self) -> str | None:
        """The stage that is being computed."""
        return self._running

    def compute(self, upto: str | None = None) -> None:
        """Compute the outdated stages, up to one stage or all of them."""

        def work(progress: Callable[[float], None]) -> None:
            while stale := self.project.stale(upto=upto):
                progress(0.0)
                self._running = stale[0]
                try:
                    self.project.compute(stale[0], progress)
                finally:
                    self._running = None

        if self.project.stale(upto=upto):
            self.jobs.submit(Job(tr("Computing"), work, lambda _nothing: self.changed.emit()))
            self.changed.emit()

    def close(self) -> None:
        """Stop all work and release the camera; captured images are written first."""
        self.live.finish()
        self.short_jobs.close()
        self.jobs.close()
        self.undo.clear()
