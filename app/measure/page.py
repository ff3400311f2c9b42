"""The Measure page: measure what is pressed, and what was measured before."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QTabWidget, QVBoxLayout, QWidget

from app.inspect.first_calibration import begin_first_calibration
from app.measure.desk import PICTURES, RECORDING, Desk
from app.measure.indenters_dialog import IndentersDialog
from app.measure.keeping import Kept, record_of
from app.measure.limits_dialog import LimitsDialog
from app.measure.protocol_view import ProtocolView
from app.measure.record_book import RecordBook
from app.measure.record_table import quantity_text, shape_label
from app.measure.results_view import ResultsView
from app.shell.context import AppContext
from app.shell.dropping import dropped_paths
from app.shell.jobs import Jobs
from app.shell.settings import Limits
from app.widgets.naming import named
from app.workspace.indenters import FILE as INDENTERS
from app.workspace.indenters import Indenter, read_indenters, write_indenters
from gelpolight_core.errors import InputError
from gelpolight_core.records.entry import MeasurementRecord
from gelpolight_core.session.outside import KnownFiles
from gelpolight_core.translation import tr


class MeasurePage(QWidget):
    """Tools on the height map, the lab's records, and the evaluation protocol.

    Parameters
    ----------
    context : AppContext
        The program's.
    """

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()
        named(self, "measure", tr("Measure"))
        self.setAcceptDrops(True)
        self.context = context
        self.jobs = Jobs("measure-jobs", self)
        self.desk = Desk(self.jobs, context=context)
        self.tabs = named(QTabWidget(), "measure.tabs", tr("Parts of this page"))
        self.tabs.setDocumentMode(True)
        self.tabs.tabBar().setDrawBase(False)
        self.book = RecordBook(context=context, parent=self)
        self.results = ResultsView(self.book, context=context)
        self.tabs.addTab(self.desk, tr("Measure"))
        self.tabs.addTab(self.results, tr("Records"))
        self.protocol = ProtocolView(context=context)
        self.tabs.addTab(self.protocol, tr("Evaluation protocol"))
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.tabs)
        self._shown = False
        self.tabs.currentChanged.connect(lambda _index: self._on_tab())
        self.desk.calibrate_wanted.connect(self.calibrate_now)
        self.desk.indenters_wanted.connect(self.edit_indenters)
        self.desk.limits_wanted.connect(self.edit_limits)
        self.desk.kept.connect(self.keep)
        self.desk.panel.records_wanted.connect(lambda: self.tabs.setCurrentWidget(self.results))
        self.protocol.completed.connect(self._keep_evaluation)
        self.book.changed.connect(self._show_count)
        self.book.refused.connect(lambda text: context.toasts.show(text, "fail"))
        self.book.noticed.connect(lambda text: context.toasts.show(text, "warn"))
        self.jobs.progressed.connect(self.desk.banner.show_work)
        self.jobs.refused.connect(lambda text: context.toasts.show(text, "warn"))
        self.desk.banner.stop_wanted.connect(self.jobs.cancel)

    # What the window asks of a page

    def enter(self) -> None:
        """Look at the source."""
        self._shown = True
        self._read_indenters()
        self.book.refresh()
        self._on_tab()

    def leave(self) -> None:
        """Let the source go."""
        self._shown = False
        self.desk.leave()
        self.protocol.leave()

    def _on_tab(self) -> None:
        """Have only the part that is shown hold the source."""
        if not self._shown:
            return
        shown = self.tabs.currentWidget()
        for part in (self.desk, self.protocol):
            if part is not shown:
                part.leave()
        if shown in (self.desk, self.protocol):
            shown.enter()

    def may_close(self) -> bool:
        """Everything that was kept is on disk."""
        self.desk.close_work()
        self.protocol.may_close()
        self.jobs.close()
        self.book.close()
        return True

    def open_path(self, path: Path) -> None:
        """Measure on a picture, or play a recording.

        Raises
        ------
        InputError
            If it is neither.
        """
        self.tabs.setCurrentWidget(self.desk)
        self.desk.open_file(path)

    def begin_demo(self) -> None:
        """Measure on the virtual sensor."""
        self.context.source.choose_virtual_sensor()

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Take pictures and recordings; all else is the window's."""
        paths = dropped_paths(event.mimeData())
        if any(path.suffix.lower() in (*PICTURES, RECORDING) for path in paths):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Open the first of them."""
        paths = dropped_paths(event.mimeData())
        wanted = [path for path in paths if path.suffix.lower() in (*PICTURES, RECORDING)]
        try:
            self.open_path(wanted[0])
        except InputError as error:
            self.context.toasts.show(str(error), "fail")
        event.acceptProposedAction()

    # The records

    def keep(self, kept: Kept) -> None:
        """Write a result into the records, at once."""
        record = record_of(kept)

        def done(number: int) -> None:
            text = tr("Kept as number {n}: {what}, {value}.").format(
                n=number,
                what=shape_label(record.shape).lower(),
                value=quantity_text(record.quantities[0]),
            )
            self.desk.panel.note.clear()
            # No message over the window: it would lie on the button for the next one.
            self.desk.panel.say_kept(text)

        self.book.add(record, done, calibration=self.desk.calibration)

    def _keep_evaluation(self, record: MeasurementRecord) -> None:
        """Write a run that is complete into the records, once."""

        def done(number: int) -> None:
            if number:
                text = tr("The evaluation is in the records as number {n}.")
                self.context.toasts.show(text.format(n=number), "pass")

        self.book.add_once(record, done)

    def _show_count(self) -> None:
        count = len(self.book.records)
        place = self.tabs.indexOf(self.results)
        self.tabs.setTabText(place, tr("Records ({n})").format(n=count) if count else tr("Records"))

    # Lists and limits

    def _read_indenters(self) -> tuple[Indenter, ...] | None:
        """Show the known indenters and return them; None where they cannot be read."""
        try:
            known = read_indenters(self.context.workspace.folder)
        except InputError as error:
            self.context.toasts.show(str(error), "fail")
            self.desk.panel.truth.show_indenters(())
            return None
        self.desk.panel.truth.show_indenters(known)
        return known

    def edit_indenters(self) -> None:
        """Edit the known indenters."""
        list_file = self.context.workspace.folder / INDENTERS
        before = KnownFiles([list_file])
        known = self._read_indenters()
        if known is None:
            return  # what is damaged is not written over
        dialog = IndentersDialog(known, self)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.accepted.connect(lambda: self._keep_indenters(dialog.indenters, before, list_file))
        dialog.open()

    def _keep_indenters(
        self, indenters: tuple[Indenter, ...], before: KnownFiles, list_file: Path
    ) -> None:
        try:
            again = tr("Open the list again, then make your change again")
            before.refuse_changed(list_file, advice=again)
            write_indenters(indenters, self.context.workspace.folder)
        except InputError as error:
            self.context.toasts.show(str(error), "fail")
        self._read_indenters()

    def edit_limits(self) -> None:
        """Edit up to which error a measurement passes."""
        dialog = LimitsDialog(self.context.settings.limits, self)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.accepted.connect(lambda: self._keep_limits(dialog.limits))
        dialog.open()

    def _keep_limits(self, limits: Limits) -> None:
        self.context.settings.limits = limits
        self.desk.judge_again()
        self.results.refresh()

    def calibrate_now(self) -> None:
        """Calibrate the virtual sensor, so that there is something to measure with."""
        begin_first_calibration(self.jobs, context=self.context)
