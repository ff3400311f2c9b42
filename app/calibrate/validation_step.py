"""The validation step: objects of known size, measured with the saved calibration."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from PySide6.QtCore import QSignalBlocker, QTimer
from PySide6.QtWidgets import QWidget

from app.program.calibration_entries import read_entry
from app.program.calibration_status import put_into_use
from app.program.file_dialogs import ask_several, image_patterns
from app.program.indenters import read_indenters
from app.program.jobs import BackgroundJob
from app.sources.virtual_bench import BenchScene
from app.widgets.actions import push_button
from app.widgets.forms import Form
from app.widgets.inputs import ComboBox, NumberField
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.text_roles import named_label, set_property, set_text_role
from app.widgets.widget_names import set_names
from gelpolight_core.base.compared_quantity import DECISIONS
from gelpolight_core.base.errors import InputError, as_input_error, error_message
from gelpolight_core.base.finding import Finding
from gelpolight_core.calibration.annotations import write_validation
from gelpolight_core.calibration.calibration_file import read_calibration
from gelpolight_core.lab.evaluation_run import MeasurementOrReason, measure_press, refuse_source
from gelpolight_core.lab.press_folder import FOLDER, add_presses, leave_out
from gelpolight_core.lab.reference_press import ReferencePress, listed_presses
from gelpolight_core.lab.validation_trial import is_recordable, object_name, press_lines, validate
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.reference_object import LENGTHS, SHAPES, ReferenceObject
from gelpolight_core.session.session_images import average_frames, write_image
from gelpolight_core.session.validation import WORDS, Validation

from .detection_marks import read_raw
from .image_panels import ImagePanel, depth_panel
from .page_state import BEGUN, UNRECORDED, RemedyButton, StepState
from .press_table import PressTable
from .result_step import ask_report
from .step import Step

_LOG = logging.getLogger(__name__)
FRAMES = 4
ASKED = ("shape", *LENGTHS)


class ValidationStep(Step):
    """Guides through presses of known objects, measures them and records the result.

    The presses are in the folder ``presses`` of the session, as ``gelpolight evaluate`` reads it.
    """

    guide = "guide/validate", "validate"

    key, title, stages = "validation", "Validation", ()
    task = "Press objects of known size. Every measured size must conform to the tolerance."
    assembly = "indenter"
    frames = FRAMES
    button = "&Measure the press"

    _presses: tuple[ReferencePress, ...] = ()
    _retaken = ""
    """Image of the press that is made again."""
    _newest: tuple[ReferencePress, HeightMap | None] | None = None
    """The press measured last."""
    _asked: tuple[Path, Path, int] | None = None
    """Calibration, image and its time of the running measurement; another one is dropped."""
    _reconstructor: tuple[Path | None, Reconstructor | None] = None, None
    """Of the calibration at this path."""

    def build(self) -> None:
        """Create the form of the objects, the list of presses, and the button that records."""
        self._outcomes: dict[str, MeasurementOrReason] = {}
        self.known = set_names(ComboBox(characters=12), "validation.known", "Saved indenter")
        self.known.activated.connect(lambda _index: self._on_known())
        self.form = Form(ReferenceObject(size_mm=5.0), "validation", only=ASKED, narrow=True)
        self.form.changed.connect(lambda _name, _value: self._on_typed())
        self.count_asked = NumberField(minimum=1, maximum=99, value=3)
        set_names(self.count_asked, "validation.count", "Presses")
        repeats = hbox(PlainLabel("Presses"), (self.count_asked, 1), margins=0)
        add = push_button("validation.add", "&Add to the list", self.add)
        entry = QWidget()
        vbox(self.known, self.form, repeats, add, of=entry, margins=0)
        self.next_press = named_label("validation.next", "Next press", bold=1.0)
        self.table = PressTable(on_retake=self.retake, on_leave_out=self.leave_out)
        self.result = named_label("validation.result", "Newest measurement")
        self.verdict = named_label("validation.verdict", "All presses together")
        self.calibration = named_label("validation.calibration", "Calibration to validate")
        listed = QWidget()
        parts = self.next_press, self.table, self.verdict, self.result, self.calibration
        vbox(*parts, of=listed, margins=0)
        self.keep = push_button("validation.keep", "&Record this validation", self.record)
        set_property(self.keep, "primary", True)
        self.own = (
            self.panel.add_extra("Presses", listed),
            self.panel.add_extra("Objects to press", entry),
            self.panel.add_foot(self.keep),
        )
        self.context.requests.calibrations_changed.connect(self.model.changed)
        self._find_earlier()

    def enter(self) -> None:
        """Show the step, with the saved indenters and the presses made so far."""
        super().enter()
        with self.context.toasts.errors():
            indenters = read_indenters(self.context.workspace.folder)
            named = ((indenter.name, indenter) for indenter in indenters)
            self.known.offer([("Sizes as entered", None), *named])
        self._follow()

    def focus(self) -> QWidget:
        """Return the button that measures."""
        return self.panel.capture

    # What is shown

    def state(self) -> StepState:
        """Return whether the saved calibration is validated."""
        validation = self._recorded()
        if validation is None:
            made = BEGUN if self._missing else UNRECORDED
            return made if self.placed() else "empty", "Not validated yet"
        if not self.model.saved:
            return "stale", "The captures or corrections have changed since the validation"
        text = f"{WORDS[validation.verdict]} by {validation.basis}. {validation.what_decides}"
        if validation.passed:
            in_use = self.context.workspace.in_use == self.model.saved_path
            largest = f"Largest error {validation.largest_percent:.2g} %"
            text += f"{largest}. {'In use' if in_use else 'Not in use'}."
        return validation.verdict.value, text.strip()

    def number(self) -> Finding | None:
        """Return the largest error of the recorded validation, or else of the present presses."""
        validation = self._recorded() or self._trial()
        if validation is None or not validation.comparisons:
            return None
        return Finding("largest_error", "Largest error", validation.largest_percent, "%")

    def remedies(self, state: str) -> tuple[RemedyButton, ...]:
        """Return what follows a validation."""
        if state != "pass":
            return ()
        if self.context.workspace.in_use != self.model.saved_path:
            use = partial(put_into_use, self.model.saved_path, self.area, context=self.context)
            return (("&Use it now", use),)
        page = self.context.requests.page
        return (
            ("&Inspect", partial(page.emit, "inspect")),
            ("M&easure", partial(page.emit, "measure")),
            ("&Report…", partial(ask_report, self)),
        )

    def progress_line(self) -> str:
        """Return how many of the listed presses are made."""
        total = len(self._presses)
        return f"{self.placed()} of {total} presses made" if total else ""

    def placed(self) -> int:
        """Return how many of the listed presses are made."""
        return len(self._presses) - len(self._missing)

    def result_panels(self) -> tuple[ImagePanel, ...]:
        """Return the depth of the press measured last."""
        if self._newest is None or self._newest[1] is None:
            return ()
        measured, heightmap = self._newest[0].measurement, self._newest[1]
        outline_mm = None if measured is None else measured.outline_mm
        display = self.context.display.value
        return (depth_panel("Measured depth", heightmap, display, outline_mm),)

    def refresh(self) -> None:
        """Show which calibration is validated. Measurements belong to one of them."""
        path, present = self.model.saved_path, bool(self.model.saved)
        text = "Save the calibration first. A validation belongs to a saved calibration."
        if path is not None:
            text = f"{path.stem}: captures or corrections have changed since. Save it again."
        self.calibration.setVisible(not present)
        self.calibration.setText(text)
        set_text_role(self.calibration, "" if present else "warn")
        if path != self._reconstructor[0]:
            self._follow()
        elif self.model.page.step is self:
            self._show_presses()  # the tolerances may be others

    def on_bench(self, scene: BenchScene) -> None:
        """Press the next object with the virtual bench, or enter the object on it into the form."""
        bench, press = self.context.source.bench, self._next()
        if bench is not None and press is not None:
            bench.place_object(press.truth.shape)
            depth_mm = press.truth.height_mm or scene.depth_mm
            size_mm, x_mm, y_mm = press.truth.size_mm, scene.x_mm, scene.y_mm
            bench.set_scene(size_mm=size_mm, depth_mm=depth_mm, x_mm=x_mm, y_mm=y_mm)
        elif (truth := scene.truth) is not None:
            self.show_known(truth)

    # The objects

    def show_known(self, truth: ReferenceObject) -> None:
        """Fill in an object."""
        self.form.show_value(truth if truth.shape in SHAPES else replace(truth, shape="cylinder"))

    def _on_known(self) -> None:
        if (truth := self.known.currentData()) is not None:
            self.show_known(truth)

    def _on_typed(self) -> None:
        """Forget the saved indenter: its values are no longer those."""
        self.form.value = replace(self.form.value, name="", certificate="", due="", serial="")
        with QSignalBlocker(self.known):
            self.known.setCurrentIndex(0)

    # The calibration

    def _find_earlier(self) -> None:
        """Select the calibration of the present captures, or the newest one of the session."""
        project = self.project
        session, present = project.session, project.all_inputs
        entries = self.context.toasts.read_list(self.context.workspace.entries)
        to_validate = self.context.workspace.to_validate
        candidates = [
            (entry.path != to_validate, entry.summary.inputs != present, entry.path)
            for entry in entries
            if entry.summary is not None
            and entry.summary.session == session.folder.name
            and entry.serial == session.serial
        ]
        if candidates:
            *_, path = min(candidates, key=lambda candidate: candidate[:2])
            self.model.use_calibration(path)
            if path == to_validate:
                self.context.workspace.to_validate = None
                # Not at once: the wizard is not made yet, and then shows another step.
                QTimer.singleShot(0, self.area, partial(self.model.step_requested.emit, self.key))

    def _recorded(self) -> Validation | None:
        path = self.model.saved_path
        return None if path is None else read_entry(path).validation

    # The list of presses

    @property
    def _folder(self) -> Path:
        return self.session.folder / FOLDER

    @property
    def _missing(self) -> tuple[ReferencePress, ...]:
        """The presses that are still to be made."""
        folder = self._folder
        return tuple(press for press in self._presses if not (folder / press.file).is_file())

    def _next(self) -> ReferencePress | None:
        """Return the press to make next, or None if all are made."""
        again = (press for press in self._presses if press.file == self._retaken)
        return next(again, next(iter(self._missing), None))

    def add(self) -> None:
        """List the object of the form as often as it is to be pressed."""
        count = int(self.count_asked.value())
        self._change(partial(add_presses, self._folder, self.form.value, count))
        self.panel.reveal(self.next_press)

    def retake(self, press: ReferencePress) -> None:
        """Make a press again. The next capture replaces its image."""
        self._retaken = press.file
        self._follow()

    def leave_out(self, press: ReferencePress) -> None:
        """Remove a press from the list. Its image stays in the folder."""
        self._change(partial(leave_out, self._folder, press.file))

    def _change(self, change: Callable[[], object]) -> None:
        """Change the folder of presses, and show it."""
        with self._errors():
            change()
        self._follow()

    def _file_for(self, truth: ReferenceObject | None = None) -> str:
        """Return the image of the next press, or of one more press if all are made.

        Parameters
        ----------
        truth : ReferenceObject, optional
            Pressed object, by default the next one of the list, or the object of the form.
        """
        press = self._next()
        if truth is not None:
            press = next((press for press in self._missing if press.truth == truth), None)
        if press is not None:
            return press.file
        return add_presses(self._folder, truth or self.form.value, 1)[0]

    def _follow(self) -> None:
        """Show the presses in the folder, and measure those that are not measured yet."""
        path = self.model.saved_path
        if path != self._reconstructor[0]:
            self._reconstructor, self._newest = (path, None), None
            self._outcomes.clear()
        listed: tuple[ReferencePress, ...] = ()
        with self._errors():
            listed = listed_presses(self._folder)
        self._presses = tuple(replace(p, outcome=self._outcomes.get(p.file, "")) for p in listed)
        if self.model.page.step is self:
            self.model.changed.emit()
            self._measure_next()

    def _show_presses(self) -> None:
        """Show the next press, what was measured, and the verdict of all presses."""
        limits, missing = self.context.settings.limits.percent, self._missing
        count, next_press = len(self._presses), self._next()
        if next_press is not None:
            number = [press.file for press in self._presses].index(next_press.file) + 1
            truth = next_press.truth
            depth = f", depth {truth.height_mm:g} mm" if truth.height_mm else ""
            text = f"Press {number} of {count}: {object_name(truth).lower()}{depth}"
        elif count:
            text = "All presses are made"
        else:
            text = "Nothing is listed yet. Add an object below, or measure one press of it."
        self.next_press.setText(text)
        self.table.show_presses(self._presses, {press.file for press in missing}, limits)
        trial, recorded = self._trial(), self._recorded()
        recordable = trial is not None and is_recordable(self._presses, trial)
        is_new = recorded is None or trial is None or recorded.comparisons != trial.comparisons
        self.keep.setEnabled(recordable and is_new)
        text, role = ("", "") if self._newest is None else press_lines(self._newest[0], limits)
        self.result.setText(text)
        self.result.setVisible(bool(text))
        set_text_role(self.result, role)
        self.verdict.setVisible(trial is not None and bool(trial.comparisons))
        if trial is not None and trial.comparisons:
            largest = f"largest error {trial.largest_percent:.2g} %. {trial.what_decides}"
            text = f"{DECISIONS[trial.verdict].capitalize()} by {trial.basis}, {largest}".strip()
            doubtful = "Not validated: retake the doubtful presses, or leave them out"
            self.verdict.setText(text if recordable else doubtful)
            set_text_role(self.verdict, trial.verdict.value if recordable else "warn")

    def _trial(self) -> Validation | None:
        """Return the validation by the listed presses, or None before all of them are measured."""
        reconstructor, presses = self._reconstructor[1], self._presses
        is_complete = bool(presses) and not self._missing and all(p.outcome for p in presses)
        if reconstructor is None or not is_complete:
            return None
        limits = self.context.settings.limits.percent
        return validate(self._presses, reconstructor.calibration.identity, limits)

    # Presses

    def capture(self) -> None:
        """Capture the next press, then measure it."""
        live, fault = self.model.live, self.model.camera.fault()
        if fault:
            self._refuse(fault)
        elif live.stream is not None and not live.capturing:
            with self._errors():
                store = partial(self._store, self._file_for())
                self._follow()
                self.model.show_live("Capturing: hold the object still.", ready=True)
                still_s = self.model.live_detection.still_s
                live.capture(FRAMES, store, self._refuse, still_s=still_s)

    def choose_files(self) -> None:
        """Let the user choose images of presses, and measure them."""
        settings = self.context.settings
        if self._folder.is_dir():
            settings.keep_folder("press", self._folder)
        title, patterns = "Import images of presses", image_patterns()
        for path in ask_several(self.area, settings, "press", title, patterns):
            self.import_press(path)

    def import_press(self, path: Path) -> None:
        """Measure a press from an image file, of the object that its folder states, if any."""
        with self._errors():
            refuse_source(path, {i.sha256 for i in self.project.recipe.files(self.session)})
            frame = read_raw(path)
            truths = {press.file: press.truth for press in listed_presses(path.parent)}
            truth = truths.get(path.name)
            if truth is not None:
                self.show_known(truth)
            if path.parent != self._folder or truth is None:
                self._store(self._file_for(truth), [frame])
            else:  # it is where it belongs
                self._follow()

    def _store(self, file: str, frames: list[NDArray[Any]]) -> None:
        """Write the image of a press, which is then measured."""
        with self._errors():
            write_image(average_frames(frames), self._folder / file)
            self._retaken = ""
            self._outcomes.pop(file, None)
            self._follow()

    def _measure_next(self) -> None:
        """Measure the first press that is not measured yet."""
        path, present = self._reconstructor
        missing = set(self._missing)
        waiting = (p for p in self._presses if not p.outcome and p not in missing)
        press = next(waiting, None)
        if press is None:
            return
        if path is None:
            self._refuse(self.calibration.text())
            return
        image, truth = self._folder / press.file, press.truth
        request = path, image, image.stat().st_mtime_ns
        if self._asked == request:
            return
        self._asked = request

        def work(_progress: object) -> tuple[Reconstructor, MeasurementOrReason, HeightMap | None]:
            reconstructor = present or Reconstructor(read_calibration(path))
            try:
                return reconstructor, *measure_press(image, truth, reconstructor)
            except Exception as error:  # what is wrong with a press is its result
                if as_input_error(error) is None:
                    _LOG.exception("Measuring %s failed", image)
                return reconstructor, error_message(error), None

        def done(result: tuple[Reconstructor, MeasurementOrReason, HeightMap | None]) -> None:
            if self._asked == request:
                self._asked, self._reconstructor = None, (path, result[0])
                self.show_measured(replace(press, outcome=result[1]), result[2])

        def failed(sentence: str) -> None:
            if self._asked == request:
                self._asked = None
                self._refuse(sentence)

        self.model.show_live("Measuring.", ready=True)
        # Beside the computations: a press can be measured while the stages are computed again.
        self.model.short_jobs.submit(BackgroundJob("Measuring the press", work, done, failed))

    def show_measured(self, press: ReferencePress, heightmap: HeightMap | None) -> None:
        """Show what was measured of a press, with its depth, and measure the next one."""
        self._newest = press, heightmap
        self._outcomes[press.file] = press.outcome
        if self.model.page.step is self:
            panels = self.result_panels()
            self.model.update_page(notice=("", "pass"), live=("", "pass"), panels=panels)
            self.area.result.setChecked(bool(panels) and not self._missing)
        self._follow()

    @contextmanager
    def _errors(self) -> Iterator[None]:
        """Show an error that the user can correct, and go on after the block."""
        try:
            yield
        except InputError as error:
            self._refuse(str(error))

    def _refuse(self, sentence: str) -> None:
        if self.model.page.step is self:
            self.model.update_page(notice=(sentence, "warn"), live=("", "pass"))
        else:
            self.context.toasts.show(sentence, "warn")

    def record(self) -> None:
        """Store the trial as the validation of the calibration."""
        path, validation = self._reconstructor[0], self._trial()
        if validation is None or path is None or not is_recordable(self._presses, validation):
            return
        try:
            write_validation(validation, path)
        except InputError as error:
            self.model.show_notice(str(error), "fail")
            return
        self.model.show_notice("", "pass")
        self.context.requests.calibrations_changed.emit()
        self.panel.buttons[0].setFocus()
        self.panel.reveal_message()
