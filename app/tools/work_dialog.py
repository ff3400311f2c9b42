"""A dialog of the Tools menu that works in the background and writes a report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from PySide6.QtWidgets import QDialog, QHBoxLayout, QHeaderView, QProgressBar, QWidget

from app.context.context import AppContext
from app.services.file_dialogs import ask_folder
from app.services.jobs import Job, Jobs
from app.widgets.buttons import push_button
from app.widgets.cells_table import CellsTable, text_table
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox
from app.widgets.meaning import show_meaning
from app.widgets.naming import named


class WorkDialog(QDialog):
    """Starts, stops and reports one piece of work. Live processing rests meanwhile.

    A subclass places the widgets, and provides `run`, `show_result` and `files_of`.

    Parameters
    ----------
    name, title : str
        For object names, and for the user.
    start : str
        Text of the start button.
    context : AppContext
        Settings, and the request to rest.
    parent : QWidget, optional
        Owner.

    Attributes
    ----------
    result_shown : object
        The last result; None before the first.
    """

    def __init__(
        self,
        name: str,
        title: str,
        *,
        start: str,
        context: AppContext,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        named(self, name, title)
        self.setWindowTitle(title)
        self.context = context
        self.jobs = Jobs(name, self)
        self.result_shown: Any = None
        self.start = push_button(f"{name}.start", start, self.run)
        self.start.setDefault(True)
        self.stop = push_button(f"{name}.stop", "Stop", self.jobs.cancel)
        self.save = push_button(
            f"{name}.save", "Save report…", self.choose_report, accessible="Save the report"
        )
        self.progress = named(QProgressBar(), f"{name}.progress", "Progress")
        self.words = named(PlainLabel(), f"{name}.words", "Notes")
        self.words.setWordWrap(True)
        self.jobs.progressed.connect(self._show_work)
        self.jobs.refused.connect(lambda text: self.say(text, "warn"))

    def run(self) -> None:
        """Start the work."""
        raise NotImplementedError

    def show_result(self, result: Any) -> None:
        """Show a result."""
        raise NotImplementedError

    def files_of(self, result: Any, folder: Path) -> Sequence[Path]:
        """Write the report into a folder, in a background thread; return the files."""
        raise NotImplementedError

    def ready(self) -> bool:
        """Whether everything that the work needs is chosen."""
        return True

    def button_row(self) -> QHBoxLayout:
        """Return a row of widgets, the progress, Start and Stop."""
        return hbox((self.progress, 1), self.start, self.stop)

    def foot_row(self) -> QHBoxLayout:
        """Return a row of the notes and Save."""
        return hbox((self.words, 1), self.save)

    def result_table(self, heads: tuple[str, ...], stretched: int) -> CellsTable[tuple[str, ...]]:
        """Return an empty table of texts, one of whose columns takes the space that is left."""
        table = text_table(f"{self.objectName()}.table", "Results", heads)
        table.horizontalHeader().setStretchLastSection(False)
        table.horizontalHeader().setSectionResizeMode(stretched, QHeaderView.ResizeMode.Stretch)
        return table

    def submit(self, title: str, work: Callable[[Callable[[float], None]], Any]) -> None:
        """Work in the background while live processing rests; then show the result."""
        self.say("")
        self.context.requests.rest.emit(True)
        self.jobs.submit(
            Job(
                title,
                work,
                self._done,
                lambda text: self.say(text, "fail"),
                ended=lambda: self.context.requests.rest.emit(False),
            )
        )
        self.allow()

    def _done(self, result: Any) -> None:
        self.result_shown = result
        self.show_result(result)
        self.allow()

    def choose_report(self) -> None:
        """Let the user choose a folder, and write the report into it."""
        title = "Folder for the report"
        if chosen := ask_folder(self, self.context.settings, "report", title):
            self.write_report(chosen)

    def write_report(self, folder: Path) -> None:
        """Write the report in the background."""
        result = self.result_shown

        def done(written: Sequence[Path]) -> None:
            self.say(f"Report saved: {written[0]}", "pass")

        self.jobs.submit(
            Job(
                "Writing the report",
                lambda _progress: self.files_of(result, folder),
                done,
                lambda text: self.say(text, "fail"),
            )
        )

    def say(self, text: str, role: str = "muted") -> None:
        """Show a note; `role` is a meaning of :func:`show_meaning`."""
        self.words.setText(text)
        show_meaning(self.words, role)

    def allow(self) -> None:
        """Enable the buttons that can be used now."""
        busy = self.jobs.busy
        self.start.setEnabled(self.ready() and not busy)
        self.stop.setEnabled(busy)
        self.save.setEnabled(bool(self.result_shown) and not busy)

    def _show_work(self, title: str, share: float) -> None:
        self.progress.setFormat(f"{title}  %p %" if title else "")
        self.progress.setValue(round(100.0 * share))
        self.allow()

    def reject(self) -> None:
        """Stop the work. Qt calls this for Escape and for every other way of closing."""
        working = self.jobs.busy
        self.jobs.close()
        if working:
            self.context.requests.rest.emit(False)
        super().reject()
