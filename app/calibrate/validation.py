"""The validation step: an object of known size, measured with the saved calibration."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from PySide6.QtWidgets import QFileDialog, QWidget

from app.calibrate.detection import read_raw
from app.calibrate.maps import depth_panel
from app.calibrate.result import ask_report
from app.calibrate.states import StepState
from app.calibrate.step import Parts, StepPresenter
from app.calibrate.step_data import Step
from app.calibrate.trial import Trial, run_trial
from app.calibrate.validation_panel import SHAPES, ValidationPanel
from app.context.calibration_status import put_into_use
from app.services.jobs import Job, Jobs
from app.sources.bench import Scene
from app.workspace.entries import read_entry
from app.workspace.validation import Validation, read_validation, write_validation
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.calibration.manifest import read_summary
from gelpolight_core.errors import InputError
from gelpolight_core.io.user import user_name
from gelpolight_core.measurement.press import read_truth
from gelpolight_core.measurement.result import Truth
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.translation import tr

FRAMES = 4
TRUTH = "truth.csv"


class ValidationStep(StepPresenter):
    """Measures presses with the saved calibration, and records the result."""

    uses_camera = True

    step = Step(
        "validation",
        tr("Validation"),
        (),
        tr(
            "Press an indenter of known size into the membrane. The calibration is validated "
            "only if the measured size is within the limits."
        ),
        "indenter",
    )

    def __init__(self, parts: Parts) -> None:
        super().__init__(parts)
        page = self.context.requests.page
        form: ValidationPanel
        after = (
            ("inspect", tr("&Inspect"), lambda: page.emit("inspect")),
            ("measuring", tr("M&easure"), lambda: page.emit("measure")),
            (
                "report",
                tr("&Report…"),
                lambda: ask_report(form, self.model, self.context, form.say),
            ),
        )
        self.form = form = ValidationPanel(self.step, after)
        self._path: Path | None = None
        # Separate jobs: a press can be measured while the stages are recomputed.
        self.jobs = Jobs("validating", self)
        self.jobs.progressed.connect(lambda title, share: form.show_work(share if title else None))
        self.jobs.refused.connect(self.model.refused)
        self._reconstructor: Reconstructor | None = None
        self._trial: tuple[Trial, str] | None = None
        self._asked = object()  # identifies the newest trial; results of older ones are dropped
        requests = self.context.requests
        form.lay.clicked.connect(self.lay_wanted)
        form.help.clicked.connect(lambda: requests.guide.emit("guide/validate", "Validate"))
        form.measure.clicked.connect(self.measure)
        form.import_press.clicked.connect(self.choose_press)
        form.keep.clicked.connect(self.keep)
        form.use.clicked.connect(self.put_into_use)
        requests.calibrations_changed.connect(self._show_verdict)
        self._show_calibration()
        self._find_earlier()
        self.model.changed.connect(self._show_calibration)
        self.model.saved_as.connect(self.use_calibration)

    @property
    def side(self) -> QWidget:
        """The form for the known object."""
        return self.form

    def focus(self) -> QWidget:
        """Return the Measure button."""
        return self.form.measure

    def state(self) -> StepState:
        """Return whether the saved calibration is validated."""
        found = self._recorded()
        if found is None:
            return "empty", tr("Not validated yet")
        if not self.model.saved:
            return "stale", tr("The captures or corrections have changed since the validation")
        if found.passed:
            return "pass", tr("Validated")
        return "fail", tr("The last validation failed")

    def show_bench(self, there: bool) -> None:
        """Offer the virtual bench if there is one."""
        self.form.lay.setVisible(there)
        self.form.show_camera(self.model.live.stream is not None)

    def on_bench(self, scene: Scene) -> None:
        """Fill in the object on the virtual bench."""
        self.form.show_known(Truth(scene.item, scene.size_mm, scene.depth_mm))

    def close(self) -> None:
        """Stop the measurement."""
        self.jobs.close()

    def refresh(self) -> None:
        """Show nothing else: the form follows the model."""

    def use_calibration(self, path: str) -> None:
        """Use this saved calibration for the next trials."""
        self._path, self._reconstructor = Path(path), None
        summary = read_entry(self._path).summary
        self.model.use_saved(self._path.stem, "" if summary is None else summary.inputs)
        self._show_calibration()
        self._drop_trial()
        self._show_verdict()

    def _drop_trial(self) -> None:
        """Drop the shown trial, and one that is still running."""
        self._asked, self._trial = object(), None
        self.form.show_trial(None)

    def _find_earlier(self) -> None:
        """Select the calibration of the present captures, or the newest one of the session."""
        project = self.model.project
        session, present = project.session, project.all_inputs
        try:
            entries = self.context.workspace.entries()
        except InputError as error:
            self.context.toasts.show(str(error), "warn")
            return
        found = [
            (entry.summary.inputs != present, entry.path)
            for entry in entries
            if entry.summary is not None
            and entry.summary.session == session.folder.name
            and entry.serial == session.serial
        ]
        if found:
            self.use_calibration(str(min(found, key=lambda one: one[0])[1]))

    def _show_calibration(self) -> None:
        name = "" if self._path is None else self._path.stem
        self.form.show_calibration(name, present=bool(self.model.saved))

    def measure(self) -> None:
        """Capture the press, then measure it."""
        live, fault = self.model.live, self.model.camera_fault()
        if fault:
            self._refuse(fault)
        elif live.stream is not None and not live.capturing and self._path is not None:
            self._drop_trial()
            self.form.say(tr("Capturing: hold the object still."))
            self.form.show_work(0.0)
            live.capture(FRAMES, self._measure, self._refuse)

    def choose_press(self) -> None:
        """Let the user choose the image of a press, and measure it."""
        presses = self.model.project.session.folder / "presses"
        settings = self.context.settings
        folder = presses if presses.is_dir() else settings.folder("press")
        chosen, _ = QFileDialog.getOpenFileName(
            self.form,
            tr("Import an image of a press"),
            str(folder),
            tr("Images (*.png *.tif *.tiff)"),
        )
        if chosen:
            settings.keep_folder("press", Path(chosen).parent)
            self.import_press(Path(chosen))

    def import_press(self, path: Path) -> None:
        """Measure a press from an image file, with the true size from its folder, if given."""
        self.form.show_work(0.0)
        try:
            frame = read_raw(path)
            known = _known_in_folder(path)
        except InputError as error:
            self._refuse(str(error))
            return
        if known is not None:
            self.form.show_known(known)
        self._measure([frame])

    def _measure(self, frames: list[NDArray[Any]]) -> None:
        self._drop_trial()
        known, asked = self.form.asked.known, self._asked
        path, present = self._path, self._reconstructor
        if path is None:
            return

        def work(progress: Callable[[float], None]) -> tuple[Reconstructor, Trial]:
            reconstructor = present or Reconstructor(read_calibration(path))
            limits = self.context.settings.limits.percent
            return reconstructor, run_trial(
                frames, reconstructor, known, limits_percent=limits, progress=progress
            )

        text = tr("{shape}, {size:g} mm").format(shape=SHAPES[known.shape], size=known.size_mm)

        def done(found: tuple[Reconstructor, Trial]) -> None:
            if self._asked is asked:
                self._show(*found, text)

        def failed(sentence: str) -> None:
            if self._asked is asked:
                self._refuse(sentence)

        self.form.say(tr("Measuring."))
        self.jobs.submit(Job(tr("Measuring the press"), work, done, failed))

    def _show(self, reconstructor: Reconstructor, trial: Trial, text: str) -> None:
        self._reconstructor, self._trial = reconstructor, (trial, text)
        self.form.show_work(None)
        self.form.show_trial(trial)
        panel = depth_panel(tr("Measured depth"), trial.heightmap, trial.measurement.outline_mm)
        if not self.form.isHidden():
            self.area.show_result(panel)

    def _refuse(self, sentence: str) -> None:
        self._trial = None
        self.form.show_work(None)
        self.form.show_trial(None)
        self.form.say(sentence, "warn")

    def keep(self) -> None:
        """Store the trial as the validation of the calibration."""
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
            self.context.toasts.show(str(error), "fail")
            return
        self.context.requests.calibrations_changed.emit()
        self.model.changed.emit()

    def put_into_use(self) -> None:
        """Use the validated calibration on the other pages from now on."""
        put_into_use(self._path, self.form, context=self.context)

    def _recorded(self) -> Validation | None:
        if self._path is None:
            return None
        try:
            found = read_validation(self._path)
            if found is not None and found.identity != read_summary(self._path).identity:
                return None  # it belongs to another calibration
        except InputError as error:
            self.context.toasts.show(str(error), "warn")
            return None
        return found

    def _show_verdict(self) -> None:
        found, used = self._recorded(), self.context.workspace.in_use == self._path
        if found is None:
            text = tr("Not validated.")
        elif not found.passed:
            text = tr("Not validated: the errors of the recorded trial are beyond the limits.")
        elif used:
            text = tr("Validated: {e:.1f} %").format(e=found.largest_percent)
        else:
            text = tr("Validated: {e:.1f} %, but not in use: Inspect and Measure use another one.")
            text = text.format(e=found.largest_percent)
        role = "warn" if found is None else "pass" if found.passed else "fail"
        self.form.show_verdict(text, role, used=used)


def _known_in_folder(path: Path) -> Truth | None:
    """Return the object given for a press image in the truth.csv of its folder, or None.

    Raises
    ------
    InputError
        If the file cannot be used.
    """
    if not (path.parent / TRUTH).is_file():
        return None
    for row in read_truth(path.parent).rows:
        if row.file == path.name:
            return row.truth
    return None
