"""The Measure page: measure pressed objects, and see earlier measurements."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtGui import QAction, QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QTabWidget, QWidget

from app.context.context import AppContext
from app.measure.indenters_dialog import IndentersDialog
from app.measure.limits_dialog import LimitsDialog
from app.measure.press_view import IMAGES, RECORDING, PressView
from app.measure.protocol_view import ProtocolView
from app.measure.record_book import RecordBook
from app.measure.record_table import quantity_text, shape_label
from app.measure.results_view import ResultsView
from app.services.dropping import dropped_paths
from app.services.jobs import Jobs
from app.services.preferences import Limits
from app.widgets.layout import vbox
from app.widgets.naming import named
from app.workspace.indenters import FILE as INDENTERS
from app.workspace.indenters import Indenter, read_indenters, write_indenters
from gelpolight_core.records.entry import MeasurementRecord
from gelpolight_core.session.file_hashes import KnownFiles
from gelpolight_core.translation import tr


class MeasurePage(QWidget):
    """Tools on the height map, the lab's records, and the evaluation protocol.

    Parameters
    ----------
    context : AppContext
        Shared by all pages.
    """

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()
        named(self, "measure", tr("Measure"))
        self.setAcceptDrops(True)
        self.context = context
        context.requests.preferences_changed.connect(self._show_again)
        self.jobs = Jobs("measure-jobs", self)
        self.press_view = PressView(self.jobs, context=context)
        self.tabs = named(QTabWidget(), "measure.tabs", tr("Sections of this page"))
        self.tabs.setDocumentMode(True)
        self.tabs.tabBar().setDrawBase(False)
        self.book = RecordBook(context=context, parent=self)
        self.results = ResultsView(self.book, context=context)
        self.tabs.addTab(self.press_view, tr("Measure"))
        self.tabs.addTab(self.results, tr("Records"))
        self.protocol = ProtocolView(context=context)
        self.tabs.addTab(self.protocol, tr("Evaluation protocol"))
        vbox(self.tabs, of=self, margins=0)
        self._shown = False
        self.tabs.currentChanged.connect(lambda _index: self._on_tab())
        panel = self.press_view.panel
        panel.truth.edit.clicked.connect(self.edit_indenters)
        panel.truth.limits.clicked.connect(self.edit_limits)
        panel.kept.linkActivated.connect(lambda _: self.tabs.setCurrentWidget(self.results))
        self.press_view.kept.connect(self.keep)
        self.protocol.completed.connect(self._keep_evaluation)
        self.book.changed.connect(self._show_count)
        self.book.refused.connect(lambda text: context.toasts.show(text, "fail"))
        self.book.noticed.connect(lambda text: context.toasts.show(text, "warn"))
        self.jobs.refused.connect(lambda text: context.toasts.show(text, "warn"))

    # Called by the main window

    def enter(self) -> None:
        """Show the source."""
        self._shown = True
        self._read_indenters()
        self.book.refresh()
        self._on_tab()

    def leave(self) -> None:
        """Release the source."""
        self._shown = False
        self.press_view.leave()
        self.protocol.leave()

    def _on_tab(self) -> None:
        """Let only the visible part use the source."""
        if not self._shown:
            return
        shown = self.tabs.currentWidget()
        for part in (self.press_view, self.protocol):
            if part is not shown:
                part.leave()
        if shown in (self.press_view, self.protocol):
            shown.enter()

    def export_actions(self) -> tuple[QAction, ...]:
        """Return what the File menu offers to export from this page."""
        return (self.results.export_action,)

    def _show_again(self) -> None:
        """Show the values in another unit."""
        self.press_view.details.show_frozen()
        self.press_view.work.image_changed.emit()
        self.press_view.work.changed.emit()

    def may_close(self) -> bool:
        """Return True: all saved data is on disk."""
        self.press_view.close_work()
        self.protocol.may_close()
        self.jobs.close()
        self.book.close()
        return True

    def open_path(self, path: Path) -> None:
        """Measure on an image, or play a recording.

        Raises
        ------
        InputError
            If it is neither.
        """
        self.tabs.setCurrentWidget(self.press_view)
        self.press_view.open_file(path)

    def begin_demo(self) -> None:
        """Measure on the virtual sensor."""
        self.context.source.choose_virtual_sensor()

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Accept images and recordings. The window handles everything else."""
        paths = dropped_paths(event.mimeData())
        if any(path.suffix.lower() in (*IMAGES, RECORDING) for path in paths):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Open the first of them."""
        paths = dropped_paths(event.mimeData())
        wanted = [path for path in paths if path.suffix.lower() in (*IMAGES, RECORDING)]
        with self.context.toasts.errors():
            self.open_path(wanted[0])
        event.acceptProposedAction()

    # The records

    def keep(self, record: MeasurementRecord) -> None:
        """Write a result to the records at once."""

        def done(number: int) -> None:
            text = tr("Saved as number {n}: {what}, {value}.").format(
                n=number,
                what=shape_label(record.shape).lower(),
                value=quantity_text(record.quantities[0]),
            )
            self.press_view.panel.note.clear()
            # No toast: it would cover the button for the next result.
            self.press_view.panel.say_kept(text)

        self.book.add(record, done, calibration=self.press_view.calibration)

    def _keep_evaluation(self, record: MeasurementRecord) -> None:
        """Write a complete run to the records, once."""

        def done(number: int) -> None:
            if number:
                text = tr("The evaluation is in the records as number {n}.")
                self.context.toasts.show(text.format(n=number))

        self.book.add_once(record, done)

    def _show_count(self) -> None:
        count = len(self.book.records)
        tab = self.tabs.indexOf(self.results)
        self.tabs.setTabText(tab, tr("Records ({n})").format(n=count) if count else tr("Records"))

    # Lists and limits

    def _read_indenters(self) -> tuple[Indenter, ...] | None:
        """Read the known indenters, show and return them. None if they cannot be read."""
        known = None
        with self.context.toasts.errors():
            known = read_indenters(self.context.workspace.folder)
        self.press_view.panel.truth.show_indenters(known or ())
        return known

    def edit_indenters(self) -> None:
        """Edit the known indenters."""
        list_file = self.context.workspace.folder / INDENTERS
        before = KnownFiles([list_file])
        known = self._read_indenters()
        if known is None:
            return  # a damaged list is not overwritten
        dialog = IndentersDialog(known, self)
        dialog.accepted.connect(lambda: self._keep_indenters(dialog.indenters, before, list_file))
        dialog.open()

    def _keep_indenters(
        self, indenters: tuple[Indenter, ...], before: KnownFiles, list_file: Path
    ) -> None:
        with self.context.toasts.errors():
            before.refuse_changed(list_file)
            write_indenters(indenters, self.context.workspace.folder)
        self._read_indenters()

    def edit_limits(self) -> None:
        """Edit the maximum errors to pass."""
        dialog = LimitsDialog(self.context.settings.limits, self)
        dialog.accepted.connect(lambda: self._keep_limits(dialog.form.value))
        dialog.open()

    def _keep_limits(self, limits: Limits) -> None:
        self.context.settings.limits = limits
        self.press_view.judge_again()
        self.results.refresh()
