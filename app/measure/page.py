"""The Measure page: measure pressed objects, and see earlier measurements."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QSignalBlocker
from PySide6.QtGui import QAction, QDragEnterEvent, QDropEvent, QUndoStack
from PySide6.QtWidgets import QListWidget, QTabWidget, QWidget

from app.live.calibration_choice import use_virtual_calibration
from app.program.context import AppContext
from app.program.file_dialogs import dropped_paths
from app.program.indenters import FILE as INDENTERS
from app.program.indenters import read_indenters, write_indenters
from app.program.jobs import JobQueue
from app.widgets.actions import push_button
from app.widgets.dialog import Dialog, Kinds
from app.widgets.forms import Form
from app.widgets.layout import hbox, vbox
from app.widgets.text_roles import named_label
from app.widgets.widget_names import set_names
from gelpolight_core.base.errors import InputError
from gelpolight_core.image.image_file import SUFFIXES
from gelpolight_core.lab.measurement_record import MeasurementRecord
from gelpolight_core.output.recording.recording_format import ENDING as RECORDING
from gelpolight_core.session.file_hashes import FileSnapshots
from gelpolight_core.session.reference_object import ReferenceObject, check_named

from .press_view import PressView
from .record_table import shape_label
from .records_model import RecordsModel, number_of
from .records_view import RecordsView

NEW = ReferenceObject("cylinder", 5.0, name="New cylinder")


class IndentersDialog(Dialog):
    """Edits the list. Errors are shown below it, and an invalid list is not accepted.

    Attributes
    ----------
    indenters : tuple of ReferenceObject
        The accepted list.
    """

    def __init__(
        self, indenters: tuple[ReferenceObject, ...], parent: QWidget | None = None
    ) -> None:
        kinds = Kinds.Save | Kinds.Cancel
        super().__init__(parent, "measure.indenters", "Known objects", kinds, once=True)
        self.resize(680, 400)
        self.indenters = indenters
        self._typed = list(indenters)
        self.names = set_names(QListWidget(), "measure.indenters.names", "Known objects")
        self.form = Form(NEW, "measure.indenters")
        self.problem = named_label("measure.indenters.problem", "Errors in the list", role="fail")
        add = push_button("measure.indenters.add", "&Add", self.add, icon_name="add")
        remove = push_button("measure.indenters.remove", "&Remove", self.remove, icon_name="remove")
        for button in (add, remove):
            button.setAutoDefault(False)
        names = vbox((self.names, 1), hbox(add, remove))
        self.fill(hbox((names, 1), (vbox(self.form, None), 1), spacing=16), self.problem)
        self.names.setWordWrap(True)  # a name is never cut
        self.names.addItems([typed.name for typed in self._typed])
        self.names.currentRowChanged.connect(self._show)
        self.form.changed.connect(lambda _name, _value: self._keep())
        self.names.setCurrentRow(0)
        self._show(self.names.currentRow())

    def add(self) -> None:
        """Add an object at the end."""
        self._typed.append(NEW)
        self.names.addItem(self._typed[-1].name)
        self.names.setCurrentRow(len(self._typed) - 1)

    def remove(self) -> None:
        """Remove the chosen object."""
        if (row := self.names.currentRow()) >= 0:
            del self._typed[row]
            with QSignalBlocker(self.names):
                self.names.takeItem(row)
            self._show(self.names.currentRow())

    def _show(self, row: int) -> None:
        self.form.setEnabled(row >= 0)
        self.form.show_value(self._typed[row] if row >= 0 else NEW)

    def _keep(self) -> None:
        row = self.names.currentRow()
        self._typed[row] = self.form.value
        self.names.item(row).setText(self.form.value.name)

    def accept(self) -> None:
        """Accept the list, or show its first error."""
        for row, typed in enumerate(self._typed):
            try:
                check_named(typed)
            except InputError as error:
                self.names.setCurrentRow(row)
                self.problem.setText(str(error))
                return
        self.indenters = tuple(self._typed)
        super().accept()


class MeasurePage(QWidget):
    """Tools on the height map, and the lab's records.

    Parameters
    ----------
    context : AppContext
        Shared by all pages.
    """

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()
        set_names(self, "measure", "Measure")
        self.setAcceptDrops(True)
        self.context = context
        self.jobs = JobQueue("measure-jobs", self)
        self.press_view = PressView(
            self.jobs,
            on_save=self.keep,
            is_saved=lambda record: number_of(record, self.book.records) is not None,
            on_edit=self.edit_objects,
            on_records=lambda: self.tabs.setCurrentWidget(self.results),
            context=context,
        )
        self.tabs = set_names(QTabWidget(), "measure.tabs", "Sections of this page")
        self.tabs.setDocumentMode(True)
        self.tabs.tabBar().setDrawBase(False)
        self.book = RecordsModel(context=context, parent=self)
        self.results = RecordsView(self.book, on_open=self._try_file, context=context)
        self.tabs.addTab(self.press_view, "Measure")
        self.tabs.addTab(self.results, "Records")
        vbox(self.tabs, of=self, margins=0)
        self._shown = False
        self.tabs.currentChanged.connect(lambda _index: self._on_tab())
        self.book.changed.connect(self._show_count)
        self.book.changed.connect(self.press_view.refresh)
        self.book.noticed.connect(self._on_problem)
        self.jobs.refused.connect(self._on_problem)
        context.requests.preferences_changed.connect(self._show_again)

    def _on_problem(self, text: str) -> None:
        """Show what went wrong in the background."""
        self.press_view.inspector.show_message(text, "warn")
        self.results.message.setText(text)

    # Called by the main window

    def enter(self) -> None:
        """Show the source."""
        self._shown = True
        self._read_objects()
        self.book.refresh()
        self._on_tab()

    def leave(self) -> None:
        """Release the source."""
        self._shown = False
        self.press_view.leave()

    def _on_tab(self) -> None:
        """Use the source only while the press is visible."""
        if not self._shown:
            return
        if self.tabs.currentWidget() is self.press_view:
            self.press_view.enter()
        else:
            self.press_view.leave()

    @property
    def history(self) -> QUndoStack:
        """What the edit menu undoes: changes of the tools, or of the records."""
        is_measuring = self.tabs.currentWidget() is self.press_view
        return self.press_view.work.undo if is_measuring else self.book.undo

    def export_actions(self) -> tuple[QAction, ...]:
        """Return what the File menu offers to export from this page."""
        shown = self.tabs.currentWidget() is self.press_view
        return (self.press_view.certificate_action(shown=shown), self.results.export_action)

    def _show_again(self) -> None:
        """Judge the values by other limits."""
        self.press_view.refresh()
        self.results.refresh()

    def unfinished(self) -> str:
        """Return what would be lost if the window was closed. Empty: nothing."""
        return self.press_view.unfinished()

    def can_close(self) -> bool:
        """Return True: all saved data is on disk."""
        self.press_view.close_work()
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
        """Measure a cylinder on the virtual sensor."""
        self.tabs.setCurrentWidget(self.press_view)
        self.press_view.begin()
        self.press_view.inspector.bench.title.setChecked(True)
        self.context.source.choose_virtual_sensor().place_object("cylinder")
        use_virtual_calibration(self.jobs, context=self.context)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Accept images and recordings. The window handles everything else."""
        if _usable_paths(event):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Open the first of them."""
        self._try_file(_usable_paths(event)[0])
        event.acceptProposedAction()

    def _try_file(self, path: Path) -> None:
        self.tabs.setCurrentWidget(self.press_view)
        self.press_view.try_file(path)

    # The records

    def keep(self, record: MeasurementRecord) -> None:
        """Write a result to the records at once."""

        def done(number: int) -> None:
            text = (
                f"Saved as number {number}: {shape_label(record.shape).lower()}, "
                f"{record.quantities[0].text}."
            )
            self.press_view.inspector.remarks.change(note="")
            self.press_view.inspector.show_message(text, "pass", link="Show records")

        image = self.press_view.work.image
        self.book.add(record, done, None if image is None else image.frame)

    def _show_count(self) -> None:
        count = len(self.book.records)
        tab = self.tabs.indexOf(self.results)
        self.tabs.setTabText(tab, f"Records ({count})" if count else "Records")

    # The known objects

    def _read_objects(self) -> tuple[ReferenceObject, ...] | None:
        """Read the known objects, show and return them. None if they cannot be read."""
        objects = None
        with self.context.toasts.errors():
            objects = read_indenters(self.context.workspace.folder)
        self.press_view.inspector.reference.show_objects(objects or ())
        return objects

    def edit_objects(self) -> None:
        """Edit the known objects."""
        list_file = self.context.workspace.folder / INDENTERS
        before = FileSnapshots([list_file])
        objects = self._read_objects()
        if objects is None:
            return  # a damaged list is not overwritten
        dialog = IndentersDialog(objects, self)
        dialog.accepted.connect(lambda: self._keep_objects(dialog.indenters, before, list_file))
        dialog.open()

    def _keep_objects(
        self, objects: tuple[ReferenceObject, ...], before: FileSnapshots, list_file: Path
    ) -> None:
        with self.context.toasts.errors():
            before.refuse_changed(list_file)
            write_indenters(objects, self.context.workspace.folder)
        self._read_objects()


def _usable_paths(event: QDropEvent) -> list[Path]:
    """Return the images and recordings of a drag."""
    paths = dropped_paths(event.mimeData())
    return [path for path in paths if path.suffix.lower() in (*SUFFIXES, RECORDING)]
