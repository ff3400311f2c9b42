"""The calibration step: all figures together, saving and the report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QPushButton,
    QToolButton,
    QWidget,
)

from app.calibrate.states import (
    RUNNING,
    StepState,
    is_done,
    state_icon,
    state_meaning,
    state_word,
    step_state,
)
from app.calibrate.step import Parts, StepPresenter
from app.calibrate.step_data import Step
from app.services.file_dialogs import ask_save
from app.services.jobs import Job
from app.widgets.label import PlainLabel, RoomyLabel
from app.widgets.layout import hbox, scroll_area, vbox
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from app.widgets.quality_table import QualityTableWidget
from app.widgets.sign import Sign
from app.workspace.report import stated_validation
from gelpolight_core.calibration.missing import OPEN_FOLDERS
from gelpolight_core.calibration.project import Run
from gelpolight_core.calibration.status import StageState, StageStatus
from gelpolight_core.causes import with_one_cause
from gelpolight_core.finding import Finding, QualityTable
from gelpolight_core.translation import tr

FAIL = StageState.FAIL


class ResultView(QWidget):
    """Shows all stages and the buttons to save the calibration and its report.

    Signals
    -------
    step_wanted(str)
        Key of a step to go to.
    """

    step_wanted = Signal(str)

    def __init__(self, steps: Sequence[Step]) -> None:
        super().__init__()
        named(self, "result", tr("Calibration"))
        self._rows: dict[str, _StageRow] = {}
        self._name = ""
        self.headline = named(PlainLabel(wrap=True), "result.headline", tr("Verdict"))
        make_bold(self.headline, size=1.2)
        self.cause = named(PlainLabel(wrap=True), "result.cause", tr("Most likely cause"))
        make_bold(self.cause)
        inside = QWidget()
        rows = vbox(of=inside)
        for step in steps:
            for stage in step.stages:
                if stage not in self._rows:
                    self._rows[stage] = _StageRow(step)
                    self._rows[stage].step_wanted.connect(self.step_wanted)
                    rows.addWidget(self._rows[stage])
        rows.addStretch(1)
        scroll = named(scroll_area(inside), "result.scroll", tr("All stages"))
        self.save = named(
            QPushButton(tr("&Save the calibration")), "result.save", tr("Save the calibration")
        )
        self.report = named(
            QPushButton(tr("Write the &report…")), "result.report", tr("Write the report")
        )
        for button in (self.save, self.report):
            button.setMinimumHeight(38)
        self.saved = named(RoomyLabel("\n"), "result.saved", tr("Where it was saved"))
        self.saved.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        vbox(
            self.headline,
            self.cause,
            (scroll, 1),
            hbox(self.save, self.report),
            self.saved,
            of=self,
        )

    def show_saved(self, sentence: str, role: str = "pass") -> None:
        """Show where the calibration or its report was saved, or why it was not."""
        self.saved.setText(sentence)
        show_meaning(self.saved, role)

    def show_states(
        self,
        states: Mapping[str, tuple[str, str]],
        statuses: Mapping[str, StageStatus],
        *,
        busy: bool,
        saved: str = "",
    ) -> None:
        """Show the state of every stage.

        Parameters
        ----------
        states : mapping
            State and sentence by the step's key, as the list of steps shows them.
        statuses : mapping
            Status of every stage.
        busy : bool
            Whether a stage is being computed or waits for it.
        saved : str, optional
            Name of the saved calibration that belongs to the present captures.
        """
        if self._name and not saved:
            self.show_saved("")  # what was saved is no longer what the captures give
        self._name = saved
        cause, tables = with_one_cause({stage: statuses[stage].quality for stage in self._rows})
        self.cause.setText(f"{cause}." if cause else "")
        self.cause.setVisible(bool(cause))
        for stage, row in self._rows.items():
            state, sentence = states[row.step.key]
            # The cause is shown once, above all stages.
            sentence = sentence.removeprefix(f"{cause}.").strip() if cause else sentence
            row.show_state(state, sentence, tables[stage])
        done = [stage for stage in self._rows if is_done(statuses[stage].state.value)]
        failed = [stage for stage in self._rows if statuses[stage].state is FAIL]
        complete, made = len(done) == len(self._rows), len(done + failed) == len(self._rows)
        warned = sum(s.state is StageState.WARN for s in statuses.values())
        open_count = sum(not is_done(s.state.value) for s in statuses.values())
        if complete and saved:
            text = tr("All stages are complete and saved as {name}. Validate the calibration next.")
        elif complete and warned:
            text = tr("All stages are complete, {n} with a warning. Read the advice, then save.")
        elif complete:
            text = tr("All stages are complete. Save the calibration, then validate it.")
        elif busy and saved:
            text = tr(
                "Saved as {name}. You can validate it now; the stages are being recomputed in the "
                "background."
            )
        elif busy:
            text = tr("Computing. Please wait.")
        elif made:
            text = tr(
                "Failed: {titles}. Correct this. Until then the calibration can be saved only as a "
                "draft, which is not used for measuring."
            )
        elif any(s.state is StageState.STALE for s in statuses.values()):
            text = tr(
                "Outdated stages: {n}. The captures have changed since they were computed. "
                "Click Recompute."
            )
        else:
            text = self._missing_sentence(statuses)
        text = text.format(
            name=saved,
            n=warned if complete else open_count,
            titles=", ".join(self._rows[stage].step.title for stage in failed),
        )
        self.headline.setText(text)
        show_meaning(self.headline, "fail" if failed else "")
        self.save.setText(tr("&Save as a draft") if failed else tr("&Save the calibration"))
        running = any(states[row.step.key][0] == RUNNING for row in self._rows.values())
        self.save.setEnabled(complete or (made and not running))
        self.save.setStyleSheet("font-weight: bold;" if complete else "")
        # The report waits for the stages by itself.
        self.report.setEnabled(self.save.isEnabled() or bool(busy and saved))

    def _missing_sentence(self, statuses: Mapping[str, StageStatus]) -> str:
        """Return the incomplete stages, and which of them need the sensor open."""
        text = tr("Incomplete stages: {n}. Complete them from top to bottom.")
        closed = [
            row.step.title
            for stage, row in self._rows.items()
            if row.step.folder in OPEN_FOLDERS and statuses[stage].state is StageState.EMPTY
        ]
        if closed:
            text += " " + tr(
                "{titles} need the open sensor. If it cannot be opened, start a new calibration "
                "and answer that the membrane is bonded."
            ).format(titles=", ".join(closed))
        return text


class _StageRow(QWidget):
    """One stage: icon, state, sentence, and its figures on demand."""

    step_wanted = Signal(str)

    def __init__(self, step: Step) -> None:
        super().__init__()
        self.step = step
        self._sign, self._word, self._sentence = Sign(), PlainLabel(), PlainLabel()
        self._sentence.setWordWrap(True)
        self._word.setMinimumWidth(96)
        make_bold(self._word)
        self.more = named(
            QToolButton(),
            f"result.{step.key}.more",
            tr("Figures of {title}").format(title=step.title),
        )
        self.more.setText(tr("Figures"))
        self.more.setCheckable(True)
        title = named(
            QPushButton(step.title, flat=True, minimumWidth=130, styleSheet="text-align: left;"),
            f"result.{step.key}",
            tr("Go to {title}").format(title=step.title),
        )
        title.clicked.connect(lambda: self.step_wanted.emit(step.key))
        row = hbox(self._sign, title, (self._word, 1), self.more)
        self.table = QualityTableWidget(
            f"result.{step.key}.quality", tr("Figures of {title}").format(title=step.title)
        )
        self.table.hide()
        self.more.toggled.connect(self.table.setVisible)
        vbox(row, self._sentence, self.table, of=self, margins=(0, 2, 0, 2))

    def show_state(self, state: str, sentence: str, quality: QualityTable) -> None:
        self._sign.show_icon(state_icon(state))
        self._word.setText(state_word(state).capitalize())
        show_meaning(self._word, state_meaning(state))
        self._sentence.setText(sentence)
        self._sentence.setVisible(bool(sentence) and state != StageState.PASS.value)
        self.table.set_table(quality)
        self.more.setVisible(bool(quality.figures))


class ResultStep(StepPresenter):
    """Shows every stage, and saves the calibration and its report."""

    def __init__(self, parts: Parts) -> None:
        super().__init__(parts)
        self.view = ResultView(parts.steps)
        self.view.step_wanted.connect(self.step_wanted)
        self.view.save.clicked.connect(self.save)
        self.view.report.clicked.connect(self.report)

    step = Step(
        "result",
        tr("Calibration"),
        ("joint",),
        tr("Check all figures together, then save the calibration."),
        "complete",
    )

    @property
    def centre(self) -> QWidget:
        """The overview."""
        return self.view

    def focus(self) -> QWidget:
        """Return the Save button."""
        return self.view.save

    def state(self) -> StepState:
        """Return the state of the last stage."""
        last = (self.step.stages or tuple(self.model.statuses))[-1:]
        step = replace(self.step, stages=last)
        return step_state(step, self.model.statuses, self.model.running, count=0)

    def is_finished(self, state: str) -> bool:
        """Return whether the present captures are saved as a calibration."""
        return is_done(state) and bool(self.model.saved)

    def is_settled(self, state: str) -> bool:
        """Return whether the calibration is saved: the user has then read the figures."""
        return self.is_finished(state)

    def refresh(self) -> None:
        """Show the present state of every stage."""
        super().refresh()
        model = self.model
        self.view.show_states(model.states, model.statuses, busy=model.jobs.busy, saved=model.saved)

    # Saving

    def save(self) -> None:
        """Write the calibration into the library, and use it from now on unless it failed."""
        project, workspace = self.model.project, self.context.workspace

        def work(_progress: object) -> tuple[Path, Finding | None]:
            calibration = project.finish().calibration
            name = f"{calibration.serial}-{datetime.now().astimezone():%Y-%m-%d-%H%M%S}"
            path = workspace.keep_calibration(calibration, name)
            if not calibration.fault:
                workspace.use(path)
            return path, calibration.fault

        def done(saved: tuple[Path, Finding | None]) -> None:
            path, fault = saved
            if fault is None:
                text = tr("Saved as {path} and now in use. Validate it next.").format(path=path)
            else:
                text = tr("Saved as a draft, {path}, and not in use: {fault}.")
                text = text.format(path=path, fault=fault.text)
            self.view.show_saved(text, "pass" if fault is None else "fail")
            self.context.requests.calibrations_changed.emit()
            self.model.saved_as.emit(str(path))

        self._submit(tr("Saving the calibration"), work, done)

    def _submit(
        self, title: str, work: Callable[[object], Any], done: Callable[[Any], None]
    ) -> None:
        self.view.show_saved(title + "…")

        def failed(sentence: str) -> None:
            self.view.show_saved(sentence, "fail")

        self.model.jobs.submit(Job(title, work, done, failed, stopped=failed))

    def report(self) -> None:
        """Ask for a file name and write the report there."""
        name = f"{self.model.project.session.serial}-report.pdf"
        title, patterns = tr("Write the report"), tr("PDF (*.pdf)")
        path = ask_save(self.view, self.context.settings, "report", title, name, patterns)
        if path is not None:
            self.write_report(path)

    def write_report(self, path: Path) -> None:
        """Write the report of the session in its present state."""
        project, workspace = self.model.project, self.context.workspace

        def work(_progress: object) -> Run:
            from gelpolight_core.report.build import run_report  # slow to import
            from gelpolight_core.report.file import write_report

            run = project.finish()
            saved = workspace.entry_of(run.calibration.identity)
            validation = None if saved is None else stated_validation(saved)
            write_report(run_report(run, validation=validation), path)
            return run

        def done(_run: Run) -> None:
            self.view.show_saved(tr("Report saved as {path}").format(path=path))

        self._submit(tr("Writing the report"), work, done)
