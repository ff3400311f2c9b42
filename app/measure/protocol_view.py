"""The evaluation protocol: set up or continue a run, make its presses, and see the result."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from pathlib import Path

from PySide6.QtWidgets import QStackedWidget, QWidget

from app.context.context import AppContext
from app.measure.protocol_press import PressingView
from app.measure.protocol_result import ResultView
from app.measure.protocol_setup import ProtocolSetup
from app.measure.protocol_work import Equipped, ProtocolWork, equip
from app.services.jobs import Job, Jobs
from app.widgets.label import PlainLabel
from app.widgets.layout import vbox
from app.widgets.meaning import show_meaning
from app.widgets.naming import named
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.user import user_name
from gelpolight_core.measurement.evaluation import Evaluation
from gelpolight_core.measurement.protocol import Protocol, check_protocol, protocol_reach_mm
from gelpolight_core.measurement.protocol_run import begin_run, open_run
from gelpolight_core.records.entry import MeasurementRecord
from gelpolight_core.records.evaluation_entry import evaluation_record

NAME_FORMAT = "%Y-%m-%d-%H%M%S"


@dataclass(frozen=True, slots=True)
class OpenRun:
    """The run that is shown, and its views."""

    work: ProtocolWork
    pressing: PressingView
    result: ResultView


class ProtocolView(QWidget):
    """The whole evaluation protocol, as a widget of a page.

    Parameters
    ----------
    on_completed : callable
        Called with the MeasurementRecord of a run that is completely evaluated.
    context : AppContext
        Shared by all pages.

    Attributes
    ----------
    run : OpenRun or None
        The run that is shown. None during the set-up.
    """

    def __init__(
        self, on_completed: Callable[[MeasurementRecord], object], *, context: AppContext
    ) -> None:
        super().__init__()
        named(self, "protocol", "Evaluation protocol")
        self.context, self._on_completed = context, on_completed
        self.run: OpenRun | None = None
        self._shown = False
        self._retiring: list[ProtocolWork] = []
        self._jobs = Jobs("protocol set-up", self)
        self._jobs.refused.connect(self._on_refused)
        self.heading = named(PlainLabel(), "protocol.heading", "Current run")
        self.heading.setMargin(8)
        self.problem = named(PlainLabel(wrap=True), "protocol.refused", "What failed")
        show_meaning(self.problem, "fail")
        self.setup = ProtocolSetup(on_begin=self.begin, on_run=self.open_run)
        self._stack = QStackedWidget()
        self._stack.addWidget(self.setup)
        vbox(self.heading, self.problem, (self._stack, 1), of=self, margins=0, spacing=0)
        self._say_run("")
        context.requests.calibrations_changed.connect(self._refresh)

    # Called by the parent page

    def enter(self) -> None:
        """Update, and start using the camera."""
        self._shown = True
        self._refresh()
        if self.run is not None and self._stack.currentWidget() is self.run.pressing:
            self.run.pressing.enter()

    def leave(self) -> None:
        """Release the camera."""
        self._shown = False
        if self.run is not None:
            self.run.pressing.leave()

    def may_close(self) -> bool:
        """Return True: everything is on disk. Running work is stopped."""
        self._close_run()
        for work in self._retiring:
            work.close()
        self._jobs.close()
        return True

    # Start a run

    def begin(self, calibration: Path) -> None:
        """Start a new run with the chosen settings."""
        wanted = self.setup.protocol()
        self._start("Reading the calibration", lambda: self._new_run(calibration, wanted))

    def open_run(self, folder: Path) -> None:
        """Continue a run."""

        def work() -> Equipped:
            run = open_run(folder)
            return equip(run, self._calibration_of(run.content.calibration))

        self._start("Opening the run", work)

    def _start(self, title: str, work: Callable[[], Equipped]) -> None:
        self.setup.show_problem("")
        self.setup.begin.setEnabled(False)
        self._jobs.submit(Job(title, lambda _progress: work(), self._show_run))

    def _new_run(self, path: Path, wanted: Protocol) -> Equipped:
        calibration = read_calibration(path)
        reach_mm = math.floor(100.0 * protocol_reach_mm(calibration)) / 100.0
        protocol = check_protocol(replace(wanted, reach_mm=reach_mm), where="settings")
        serial = calibration.serial
        name = datetime.now().astimezone().strftime(NAME_FORMAT)
        folder = self.context.workspace.protocols_folder(serial) / name
        run = begin_run(folder, protocol, serial=serial, calibration=calibration.identity)
        return equip(run, path)

    def _calibration_of(self, identity: str) -> Path:
        """Return the calibration file of a run."""
        entry = self.context.workspace.entry_of(identity)
        if entry is None:
            raise InputError(
                f"The calibration {identity} of this run is not in the library",
                self.context.workspace.sensors_folder,
                Remedy.IMPORT_CALIBRATION,
            )
        return entry.path

    # The run

    def _show_run(self, equipped: Equipped) -> None:
        self._close_run()
        self._refresh()
        content, folder = equipped.run.content, equipped.run.folder
        self._say_run(f"{content.serial}, run {folder.name}")
        work = ProtocolWork(equipped, self)
        work.jobs.refused.connect(self.problem.setText)
        leave, context = self._leave_run, self.context
        pressing = PressingView(work, context=context, on_leave=leave, on_result=self._show_result)
        result = ResultView(work, context=context, on_back=self._show_pressing, on_leave=leave)
        self.run = OpenRun(work, pressing, result)
        self._stack.addWidget(pressing)
        self._stack.addWidget(result)
        work.catch_up()
        if work.run.next() is None:
            self._show_result()
        else:
            self._show_pressing()

    def _say_run(self, text: str) -> None:
        self.heading.setText(text)
        self.heading.setVisible(bool(text))
        self.problem.clear()

    def _show_pressing(self) -> None:
        if self.run is not None:
            self._stack.setCurrentWidget(self.run.pressing)
            if self._shown:
                self.run.pressing.enter()

    def _show_result(self) -> None:
        if (run := self.run) is not None:
            run.pressing.leave()
            self._stack.setCurrentWidget(run.result)
            run.result.wait()
            run.work.evaluate(partial(self._on_evaluated, run))

    def _on_evaluated(self, shown: OpenRun, evaluation: Evaluation) -> None:
        if shown is not self.run:
            return
        evaluation = replace(evaluation, limits_percent=self.context.settings.limits.percent)
        shown.result.show_evaluation(evaluation)
        run = shown.work.run
        if run.next() is None:
            record = evaluation_record(
                evaluation,
                serial=run.content.serial,
                calibration_id=run.content.calibration,
                operator=user_name(),
                folder=str(run.folder),
            )
            if record is not None:
                self._on_completed(record)

    def _leave_run(self) -> None:
        self._close_run()
        self._refresh()
        self._stack.setCurrentWidget(self.setup)

    def _close_run(self) -> None:
        if (run := self.run) is None:
            return
        self.run = None
        run.pressing.close_run()
        run.work.jobs.progressed.disconnect(run.result.show_work)
        self._retiring.append(run.work)
        run.work.retire(lambda: self._forget(run.work))
        for view in (run.pressing, run.result):
            self._stack.removeWidget(view)
            view.deleteLater()
        self._say_run("")

    def _forget(self, work: ProtocolWork) -> None:
        if work in self._retiring:
            self._retiring.remove(work)
            work.jobs.close()
            work.deleteLater()

    # The set-up

    def _refresh(self) -> None:
        """Show the present calibrations and runs."""
        try:
            self.setup.show_entries(self.context.workspace.entries())
            folders = self.context.workspace.protocols()
            self.setup.show_runs({folder: _known(folder) for folder in folders})
        except InputError as refusal:
            self.setup.show_problem(str(refusal))

    def _on_refused(self, sentence: str) -> None:
        self.setup.show_problem(sentence)
        self._refresh()


def _known(folder: Path) -> str:
    """Return the text of a run in the list. A damaged one is reported when it is opened."""
    name = f"{folder.parent.parent.name}, {folder.name}"
    try:
        progress = open_run(folder).progress
    except InputError:
        return f"{name}\ndamaged: open it to see the reason"
    if progress.done == progress.total:
        state = f"complete, {progress.total} presses"
    else:
        state = f"{progress.done} of {progress.total} presses"
    return f"{name}\n{state}"
