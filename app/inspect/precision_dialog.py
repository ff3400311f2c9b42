"""Error against run time: measured here, on a calibration that the person chooses."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QCheckBox,
    QComboBox,
    QDialog,
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QHeaderView,
    QProgressBar,
    QPushButton,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from app.inspect.precision_plot import PrecisionPlot, errors
from app.shell.context import AppContext
from app.shell.jobs import Job, Jobs
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.meaning import show_meaning
from app.widgets.naming import named
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.errors import InputError
from gelpolight_core.experiments.work_precision import Point, pareto_front
from gelpolight_core.experiments.work_precision_trial import (
    chosen_methods,
    measure_calibration,
    measure_virtual,
)
from gelpolight_core.translation import tr

NUMBERS = ("median_ms", "p95_ms", "rms_um", "normal_deg", "height_percent", "size_percent")


class PrecisionDialog(QDialog):
    """Lets a person measure what accuracy costs on this machine.

    Parameters
    ----------
    context : AppContext
        With the library of calibrations.
    parent : QWidget, optional
        Owner.

    Attributes
    ----------
    points : tuple of Point
        What was measured last.
    """

    def __init__(self, *, context: AppContext, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        named(self, "precision", tr("Error against run time"))
        self.setWindowTitle(tr("Error against run time"))
        self.resize(940, 660)
        self.context = context
        self.jobs = Jobs("precision", self)
        self.points: tuple[Point, ...] = ()
        self._folder: Path | None = None
        self._virtual = False
        self._make_choice()
        self._make_result()
        self._lay_out()
        self.jobs.progressed.connect(self._show_work)
        self.jobs.refused.connect(lambda text: self._say(text, "warn"))

    def _make_choice(self) -> None:
        self.calibrations = named(QComboBox(), "precision.calibration", tr("Calibration"))
        self.calibrations.currentIndexChanged.connect(self._on_calibration)
        self.presses = named(PlainLabel(), "precision.presses", tr("Presses of known depth"))
        self.presses.setWordWrap(True)
        self.folder = named(
            QPushButton(tr("Session folder…")), "precision.folder", tr("Choose a session folder"),
            tr("With presses/truth.csv and truth/*.npz: the true depth of each press"),
        )  # fmt: skip
        self.folder.clicked.connect(self.choose_folder)
        self.everything = named(
            QCheckBox(tr("All methods, too (takes minutes)")), "precision.all", tr("All methods")
        )
        self.start = named(QPushButton(tr("&Measure")), "precision.start", tr("Measure"))
        self.start.setDefault(True)
        self.start.clicked.connect(self.measure)
        self.stop = named(QPushButton(tr("Stop")), "precision.stop", tr("Stop measuring"))
        self.stop.clicked.connect(self.jobs.cancel)
        self.progress = named(QProgressBar(), "precision.progress", tr("Progress"))

    def _make_result(self) -> None:
        self.error = named(QComboBox(), "precision.error", tr("Which error is drawn"))
        for name, label in errors().items():
            self.error.addItem(label, name)
        self.error.currentIndexChanged.connect(self._draw)
        self.plot = PrecisionPlot()
        self.plot.setMinimumHeight(200)
        heads = (
            tr("Method"), "ms", tr("p95 ms"), tr("RMS um"), tr("normals deg"), tr("height %"),
            tr("size %"), tr("front"),
        )  # fmt: skip
        self.table = named(QTableWidget(0, len(heads)), "precision.table", tr("What was measured"))
        self.table.setHorizontalHeaderLabels(heads)
        self.table.verticalHeader().hide()
        self.table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.table.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        mode = QHeaderView.ResizeMode
        self.table.horizontalHeader().setSectionResizeMode(mode.ResizeToContents)
        self.table.horizontalHeader().setSectionResizeMode(0, mode.Stretch)
        self.table.setMaximumHeight(170)
        self.words = named(PlainLabel(), "precision.words", tr("What there is to say"))
        self.words.setWordWrap(True)
        self.words.setMinimumHeight(2 * self.words.fontMetrics().lineSpacing())
        self.save = named(
            QPushButton(tr("Save the report…")), "precision.save", tr("Save the report"),
            tr("HTML with the diagrams, CSV and JSON"),
        )  # fmt: skip
        self.save.clicked.connect(self.choose_report)
        self.save.setEnabled(False)

    def _lay_out(self) -> None:
        where = QHBoxLayout()
        where.addWidget(self.presses, 1)
        where.addWidget(self.folder)
        begin = QHBoxLayout()
        begin.addWidget(self.everything)
        begin.addWidget(self.progress, 1)
        begin.addWidget(self.start)
        begin.addWidget(self.stop)
        form = QFormLayout()
        form.addRow(tr("Calibration"), self.calibrations)
        form.addRow(tr("Presses"), where)
        form.addRow("", begin)
        form.addRow(tr("Draw"), self.error)
        foot = QHBoxLayout()
        foot.addWidget(self.words, 1)
        foot.addWidget(self.save)
        column = QVBoxLayout(self)
        column.addLayout(form)
        column.addWidget(self.plot, 1)
        column.addWidget(self.table)
        column.addLayout(foot)

    # What is measured

    def showEvent(self, event: QShowEvent) -> None:
        """Offer the calibrations that the library has now."""
        self._show_calibrations()
        super().showEvent(event)

    def _show_calibrations(self) -> None:
        self.calibrations.clear()
        try:
            entries = self.context.workspace.entries()
        except InputError as error:
            entries = ()
            self._say(str(error), "fail")
        for entry in entries:
            if entry.summary is not None:
                self.calibrations.addItem(f"{entry.serial}  {entry.summary.identity}", entry)
                if entry.in_use:
                    self.calibrations.setCurrentIndex(self.calibrations.count() - 1)
        self._on_calibration()

    def _design(self) -> SensorDesign:
        bench = self.context.source.bench
        return SensorDesign() if bench is None else bench.design

    def _on_calibration(self) -> None:
        entry = self.calibrations.currentData()
        self._folder = None
        self._virtual = entry is not None and entry.serial == self._design().serial
        if entry is None:
            self._say(tr("There is no calibration yet: calibrate a sensor first."), "warn")
        elif self._virtual:
            self.presses.setText(tr("rendered by the virtual sensor"))
            self._say(tr("Measures what accuracy costs on this machine."))
        else:
            self.presses.setText(tr("none chosen"))
            self._say(tr("Choose a session folder of this sensor that has the truth beside it."))
        self._allow()

    def choose_folder(self) -> None:
        """Let the person choose a session folder with truth."""
        chosen = QFileDialog.getExistingDirectory(
            self, tr("Session folder with truth"), str(self.context.settings.last_folder)
        )
        if chosen:
            self.use_folder(Path(chosen))

    def use_folder(self, folder: Path) -> None:
        """Measure on the presses of a session folder."""
        self._folder = folder
        self.presses.setText(str(folder))
        self.presses.setToolTip(plain_tip(str(folder)))
        self._allow()

    def measure(self) -> None:
        """Measure, beside the window."""
        entry = self.calibrations.currentData()
        if entry is None or self.jobs.busy:
            return
        path, folder, design = entry.path, self._folder, self._design()
        chosen = chosen_methods(self.everything.isChecked())

        def work(tell: Callable[[float], None]) -> tuple[Point, ...]:
            def progress(_what: str, share: float) -> None:
                tell(share)

            calibration = read_calibration(path)
            if folder is not None:
                return measure_calibration(calibration, folder, chosen, progress=progress)
            return measure_virtual(calibration, design, chosen, progress=progress)

        self._say("")
        self.jobs.submit(
            Job(tr("Measuring"), work, self.show_points, lambda text: self._say(text, "fail"))
        )
        self._allow()

    # What came of it

    def show_points(self, points: tuple[Point, ...]) -> None:
        """Show what was measured."""
        self.points = points
        front = pareto_front(points)
        self.table.setRowCount(len(points))
        for row, point in enumerate(points):
            numbers = [getattr(point, name) for name in NUMBERS]
            cells = [point.label, *("" if v is None else _digits(v) for v in numbers)]
            cells.append(tr("yes") if point in front else "")
            for column, text in enumerate(cells):
                item = QTableWidgetItem(text)
                if column:
                    right = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
                    item.setTextAlignment(right)
                item.setToolTip(plain_tip(point.gap))
                self.table.setItem(row, column, item)
        gaps = [f"{point.label}: {point.gap}" for point in points if point.gap]
        text = tr("The dashed line is the front: nothing beats it in both time and error.")
        self._say(" ".join([text, *gaps]))
        self._draw()
        self._allow()

    def choose_report(self) -> None:
        """Let the person choose a folder, and write the report into it."""
        chosen = QFileDialog.getExistingDirectory(
            self, tr("Folder for the report"), str(self.context.settings.last_folder)
        )
        if chosen:
            self.write_report(Path(chosen))

    def write_report(self, folder: Path) -> None:
        """Write the report, beside the window."""
        points = self.points

        def work(_tell: Callable[[float], None]) -> list[Path]:
            from gelpolight_core.experiments.work_precision_report import write_work_precision

            return write_work_precision(points, (), folder)

        def done(written: list[Path]) -> None:
            self._say(tr("Written: {file}").format(file=written[0]), "pass")
            self._allow()

        def failed(sentence: str) -> None:
            self._say(sentence, "fail")

        self.jobs.submit(Job(tr("Writing the report"), work, done, failed))

    def _draw(self) -> None:
        self.plot.show_points(self.points, str(self.error.currentData()))

    def _say(self, text: str, role: str = "muted") -> None:
        self.words.setText(text)
        show_meaning(self.words, role)

    def _show_work(self, title: str, share: float) -> None:
        self.progress.setFormat(f"{title}  %p %" if title else "")
        self.progress.setValue(round(100.0 * share))
        self._allow()

    def _allow(self) -> None:
        busy = self.jobs.busy
        ready = self.calibrations.currentData() is not None
        self.start.setEnabled(ready and not busy and (self._virtual or self._folder is not None))
        self.stop.setEnabled(busy)
        self.save.setEnabled(bool(self.points) and not busy)

    def reject(self) -> None:
        """Measure no longer; Qt comes here from Escape and from every way of closing."""
        self.jobs.close()
        super().reject()


def _digits(value: float) -> str:
    """Return a number with three digits, never as a power of ten."""
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"
