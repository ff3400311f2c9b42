"""Try a saved calibration on an object of known size, and record how that went."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from PySide6.QtCore import QObject, QTimer
from PySide6.QtWidgets import QFileDialog

from app.calibrate.controller import CalibrationController
from app.calibrate.look import read_raw
from app.calibrate.maps import Panel
from app.calibrate.trial import KnownObject, Trial, run_trial
from app.calibrate.validation_panel import ValidationPanel
from app.shell.context import AppContext
from app.shell.jobs import Job, Jobs
from app.sources.source import Frame
from app.workspace.entries import read_entry
from app.workspace.validation import Validation, read_validation, write_validation
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.calibration.manifest import read_summary
from gelpolight_core.errors import InputError
from gelpolight_core.measurement.truth import read_truth
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.translation import tr
from gelpolight_core.who import user_name

FRAMES = 4
POLL_MS = 50
TRUTH = "truth.csv"


class Validating(QObject):
    """The validation step behind its panel."""

    def __init__(
        self, controller: CalibrationController, panel: ValidationPanel, *, context: AppContext
    ) -> None:
        super().__init__(panel)
        self._controller, self._panel, self._context = controller, panel, context
        self._path: Path | None = None
        self._inputs = ""  # what the calibration that is tried rests on
        # Of its own: a press is measured while the stages are computed again.
        self.jobs = Jobs("validating", self)
        self.jobs.progressed.connect(lambda title, share: panel.show_work(share if title else None))
        self.jobs.refused.connect(controller.refused)
        self._reconstructor: Reconstructor | None = None
        self._trial: tuple[Trial, str] | None = None
        self._asked = object()  # for the newest trial; what comes of one before is let go
        self._capture: Future[list[Frame]] | None = None
        self._shown: Callable[[Panel], None] = lambda _panel: None
        self._poll = QTimer(self)
        self._poll.setInterval(POLL_MS)
        self._poll.timeout.connect(self._on_poll)
        limits = context.settings.limits
        panel.size_limit.setValue(limits.size_percent)
        panel.height_limit.setValue(limits.height_percent)
        panel.trial_wanted.connect(self.measure)
        panel.import_wanted.connect(self.choose_press)
        panel.keep_wanted.connect(self.keep)
        self._show_calibration()
        self._find_earlier()
        controller.changed.connect(self._show_calibration)

    def show_pictures_in(self, shown: Callable[[Panel], None]) -> None:
        """Hand the shaded depth of every trial to `shown`."""
        self._shown = shown

    @property
    def state(self) -> tuple[str, str]:
        """How the step stands: state and sentence."""
        found = self._recorded()
        if found is None:
            return "empty", tr("Not validated yet")
        if not self.saved:
            return "stale", tr("What the calibration was made from has changed since it was tried")
        if found.passed:
            return "pass", tr("Validated")
        return "fail", tr("The last validation failed")

    @property
    def saved(self) -> str:
        """Name of the saved calibration, where it is that of the present captures."""
        if self._path is None or self._inputs != self._controller.project.all_inputs:
            return ""
        return self._path.stem

    def take(self, path: str) -> None:
        """Try this saved calibration from now on."""
        self._path, self._reconstructor = Path(path), None
        summary = read_entry(self._path).summary
        self._inputs = "" if summary is None else summary.inputs
        self._show_calibration()
        self._ask_anew()
        self._show_verdict()

    def _ask_anew(self) -> None:
        """Let go of the trial that is shown, and of one that is still to come."""
        self._asked, self._trial = object(), None
        self._panel.show_trial(None)

    def _find_earlier(self) -> None:
        """Go on with the calibration of the present captures, or the session's newest."""
        project = self._controller.project
        session, present = project.session, project.all_inputs
        try:
            entries = self._context.workspace.entries()
        except InputError as error:
            self._context.toasts.show(str(error), "warn")
            return
        found = [
            (entry.summary.inputs != present, entry.path)
            for entry in entries
            if entry.summary is not None
            and entry.summary.session == session.folder.name
            and entry.serial == session.sensor.serial
        ]
        if found:
            self.take(str(min(found, key=lambda one: one[0])[1]))

    def _show_calibration(self) -> None:
        name = "" if self._path is None else self._path.stem
        self._panel.show_calibration(name, present=bool(self.saved))

    def refresh(self) -> None:
        """Follow the camera."""
        self._panel.show_camera(self._controller.watching.stream is not None)

    def close(self) -> None:
        """Wait for nothing any more."""
        self._poll.stop()
        self._capture = None
        self.jobs.close()

    def measure(self) -> None:
        """Capture the press, then measure it."""
        stream = self._controller.watching.stream
        if stream is not None and self._capture is None and self._path is not None:
            self._ask_anew()
            self._panel.say(tr("Capturing: hold the object still."))
            self._capture = stream.capture(FRAMES)
            self._panel.show_work(0.0)
            self._poll.start()

    def choose_press(self) -> None:
        """Let the person choose a press's picture, and measure it."""
        presses = self._controller.project.session.folder / "presses"
        folder = presses if presses.is_dir() else self._context.settings.last_folder
        chosen, _ = QFileDialog.getOpenFileName(
            self._panel,
            tr("Import a picture of a press"),
            str(folder),
            tr("Pictures (*.png *.tif *.tiff)"),
        )
        if chosen:
            self.import_press(Path(chosen))

    def import_press(self, path: Path) -> None:
        """Measure a press from a picture file; its truth is what stands beside it, if anything."""
        self._panel.show_work(0.0)
        try:
            frame = read_raw(path)
            known = _known_beside(path)
        except InputError as error:
            self._refuse(str(error))
            return
        if known is not None:
            self._panel.show_known(known)
        self._measure([frame])

    def _on_poll(self) -> None:
        if self._capture is None or not self._capture.done():
            return
        self._poll.stop()
        future, self._capture = self._capture, None
        error = future.exception()
        if error is not None:
            self._refuse(str(error))
            return
        self._measure([frame.rgb for frame in future.result()])

    def _measure(self, frames: list[NDArray[Any]]) -> None:
        self._ask_anew()
        panel, asked = self._panel, self._asked
        known, path, present = panel.known(), self._path, self._reconstructor
        size_limit, height_limit = panel.size_limit.value(), panel.height_limit.value()

        def work(tell: Callable[[float], None]) -> tuple[Reconstructor, Trial]:
            reconstructor = present
            if reconstructor is None:
                assert path is not None
                reconstructor = Reconstructor(read_calibration(path))
            trial = run_trial(
                frames,
                reconstructor,
                known,
                size_limit_percent=size_limit,
                height_limit_percent=height_limit,
                tell=tell,
            )
            return reconstructor, trial

        text = tr("{shape}, {size:g} mm").format(
            shape=panel.shape.currentText(), size=known.size_mm
        )

        def done(found: tuple[Reconstructor, Trial]) -> None:
            if self._asked is asked:
                self._show(*found, text)

        def failed(sentence: str) -> None:
            if self._asked is asked:
                self._refuse(sentence)

        self._panel.say(tr("Measuring."))
        self.jobs.submit(Job(tr("Measuring the press"), work, done, failed))

    def _show(self, reconstructor: Reconstructor, trial: Trial, text: str) -> None:
        self._reconstructor, self._trial = reconstructor, (trial, text)
        self._panel.show_work(None)
        self._panel.show_trial(trial)
        self._shown(Panel(tr("Depth as measured"), trial.shaded))

    def _refuse(self, sentence: str) -> None:
        self._trial = None
        self._panel.show_work(None)
        self._panel.show_trial(None)
        self._panel.say(sentence, "warn")

    def keep(self) -> None:
        """Record the trial beside the calibration."""
        if self._trial is None or self._path is None or self._reconstructor is None:
            return
        trial, text = self._trial
        validation = Validation(
            self._reconstructor.calibration.identity,
            datetime.now(UTC).isoformat(timespec="seconds"),
            user_name(),
            text,
            trial.comparisons,
        )
        try:
            write_validation(validation, self._path)
        except InputError as error:
            self._context.toasts.show(str(error), "fail")
            return
        self._context.requests.calibrations_changed.emit()
        self._show_verdict()
        self._controller.changed.emit()

    def _recorded(self) -> Validation | None:
        if self._path is None:
            return None
        try:
            found = read_validation(self._path)
            if found is not None and found.identity != read_summary(self._path).identity:
                return None  # it is of another calibration
        except InputError as error:
            self._context.toasts.show(str(error), "warn")
            return None
        return found

    def _show_verdict(self) -> None:
        found = self._recorded()
        if found is None:
            self._panel.show_verdict(tr("Not validated."), passed=False)
        elif found.passed:
            self._panel.show_verdict(
                tr(
                    "This calibration is validated. Look through it on Inspect, or measure with it."
                ),
                passed=True,
            )
        else:
            self._panel.show_verdict(
                tr("Not validated: the recorded trial is beyond its limits."), passed=False
            )


def _known_beside(path: Path) -> KnownObject | None:
    """Return the object that a truth.csv beside a press's picture states; None where none does.

    Raises
    ------
    InputError
        If there is one that cannot be used.
    """
    if not (path.parent / TRUTH).is_file():
        return None
    for row in read_truth(path.parent).rows:
        if row.file == path.name:
            return KnownObject(row.truth.shape, row.truth.size_mm, row.truth.height_mm)
    return None
