"""The result of a run: figure, repeatability table, all presses, and the report files."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import QDesktopServices, QPainter, QPaintEvent
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QProgressBar, QTabWidget, QWidget

from app.context.context import AppContext
from app.measure.protocol_work import REPORT, ProtocolWork
from app.services.file_dialogs import ask_folder
from app.widgets.buttons import Slot, push_button
from app.widgets.cells_table import CellsTable, text_table
from app.widgets.label import MarkupLabel, PlainLabel, escaped
from app.widgets.layout import hbox, keep_space, splitter, vbox
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from app.widgets.quality_table import QualityTableWidget
from gelpolight_core.finding import verdict_word
from gelpolight_core.measurement.evaluation import Evaluation
from gelpolight_core.report.document import Listing, Report
from gelpolight_core.report.evaluation import evaluation_document, evaluation_sentence

SAVE_AS = "Write CSV and PDF into another folder"


class Drawing(QWidget):
    """A drawing of the report on white paper, as large as fits."""

    def __init__(self) -> None:
        super().__init__()
        self._renderer = QSvgRenderer(self, aspectRatioMode=Qt.AspectRatioMode.KeepAspectRatio)
        self.load = self._renderer.load
        self._renderer.repaintNeeded.connect(self.update)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draw it."""
        painter = QPainter(self)
        painter.fillRect(self.rect(), Qt.GlobalColor.white)
        self._renderer.render(painter, self.rect())


class ResultView(QWidget):
    """Shows an evaluation and writes its report.

    Parameters
    ----------
    work : ProtocolWork
        The run.
    context : AppContext
        Shared by all pages.
    on_back, on_leave : callable
        Return to the presses, and leave the run.
    """

    def __init__(
        self, work: ProtocolWork, *, context: AppContext, on_back: Slot, on_leave: Slot
    ) -> None:
        super().__init__()
        named(self, "protocol.result", "Result of the evaluation")
        self._work, self._context = work, context
        self._evaluation: Evaluation | None = None
        self._folder = work.run.folder / REPORT
        self.verdict = named(PlainLabel(), "protocol.verdict", "Verdict")
        make_bold(self.verdict, size=1.45)
        here = partial(self.save, work.run.folder / REPORT)
        self._back, save, save_as, leave = (
            push_button(f"protocol.{name}", text, slot, tip=tip)
            for name, text, slot, tip in (
                ("back", "&Continue pressing", on_back, "Return to the presses"),
                ("save", "&Save the report", here, "Write CSV and PDF next to the run"),
                ("save_as", "Save &as…", self._save_as, SAVE_AS),
                ("leave_result", "Lea&ve", on_leave, "Leave the run. Everything is saved"),
            )
        )
        save.setProperty("primary", True)
        self.sentence = named(PlainLabel(wrap=True), "protocol.sentence", "Results")
        self.figure = named(
            Drawing(), "protocol.figure", "Errors by size and height, as in the paper's Fig. 13"
        )
        self._tabs = named(QTabWidget(), "protocol.tables", "Tables")
        split = splitter(Qt.Orientation.Vertical, (self.figure, 3), (self._tabs, 2))
        self.progress = named(QProgressBar(), "protocol.result.progress", "Running work")
        keep_space(self.progress)
        self.message = named(MarkupLabel(), "protocol.message", "Last answer")
        self.message.linkActivated.connect(
            lambda _link: QDesktopServices.openUrl(QUrl.fromLocalFile(str(self._folder)))
        )
        vbox(
            hbox((self.verdict, 1), self._back, save_as, leave, save),
            self.sentence,
            (split, 1),
            hbox((self.message, 1), self.progress),
            of=self,
            margins=(16, 12, 16, 12),
            spacing=8,
        )
        work.jobs.progressed.connect(self.show_work)
        self.show_work("", 0.0)

    def wait(self) -> None:
        """Show that the evaluation is running."""
        self.verdict.setText("Measuring the remaining presses")
        show_meaning(self.verdict, "")

    def show_evaluation(self, evaluation: Evaluation) -> None:
        """Show the results."""
        self._evaluation = evaluation
        document = evaluation_document(evaluation)
        progress = self._work.run.progress
        word = verdict_word(document.verdict)
        state = (
            f"all {progress.total} presses"
            if progress.done == progress.total
            else f"{progress.done} of {progress.total} presses so far"
        )
        serial = self._work.run.content.serial
        self.verdict.setText(f"{serial}: {word} ({state})")
        show_meaning(self.verdict, document.verdict.value)
        self.sentence.setText(evaluation_sentence(evaluation) + ".")
        self.figure.load(document.sections[0].drawings[0].svg.encode())
        self._show_tables(document)
        self._back.setEnabled(self._work.run.next() is not None)

    def _show_tables(self, document: Report) -> None:
        chosen = self._tabs.currentIndex()
        old = [self._tabs.widget(index) for index in range(self._tabs.count())]
        self._tabs.clear()
        for widget in filter(None, old):
            widget.deleteLater()
        first, *more = document.sections
        last = more.pop()
        quality = QualityTableWidget("protocol.errors", "Errors and their limits")
        quality.set_table(first.quality)
        self._add_tab("Summary", quality, None)
        groups = listing_table("protocol.groups", first.listings[0])
        self._add_tab("By size and height", groups)
        for gauge in more:
            text = "      ".join(figure.sentence for figure in gauge.quality.figures)
            words = "Repeatability over all objects"
            pooled = named(PlainLabel(text, wrap=True), "protocol.pooled", words)
            table = listing_table("protocol.gauge", gauge.listings[0])
            self._add_tab("Repeatability", pooled, table)
        known = QualityTableWidget("protocol.characteristics", last.title)
        known.set_table(last.quality)
        self._add_tab("Characteristics", known, None)
        presses = listing_table("protocol.presses", document.listings[0])
        self._add_tab("Every press", presses)
        self._tabs.setCurrentIndex(min(max(chosen, 0), self._tabs.count() - 1))

    def _add_tab(self, title: str, *parts: QWidget | None) -> None:
        holder = QWidget()
        vbox(*parts, of=holder, margins=(0, 4, 0, 0))
        self._tabs.addTab(holder, title)

    def show_work(self, title: str, share: float) -> None:
        """Show the running work. An empty title: none."""
        self.progress.setVisible(bool(title))
        self.progress.setFormat(f"{title} %p %")
        # A single evaluation reports no progress.
        self.progress.setRange(0, 100 if share > 0.0 else 0)
        self.progress.setValue(round(100 * share))

    def save(self, folder: Path) -> None:
        """Write every file of the report, with the verdict shown, into a folder."""
        if self._evaluation is None:
            return

        def done(written: tuple[Path, ...]) -> None:
            self._folder = folder
            text = f"Report saved: {len(written)} files in {folder}"
            link = escaped("Open the folder")
            self.message.setText(
                f"<span style='color:@pass'>{escaped(text)}</span> <a href='#'>{link}</a>"
            )

        self._work.write_report(self._evaluation, folder, done)

    def _save_as(self) -> None:
        settings = self._context.settings
        chosen = ask_folder(self, settings, "report", "Folder for the report")
        if chosen is not None:
            self.save(chosen)


def listing_table(name: str, listing: Listing) -> CellsTable[tuple[str, ...]]:
    """Return a listing of the report as a table, in the order of the report."""
    table = text_table(name, listing.title, listing.heads)
    table.show_items(listing.rows)
    return table
