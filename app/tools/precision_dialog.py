"""Error against run time, measured on this machine with a calibration of the user's choice."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QPixmap, QShowEvent
from PySide6.QtWidgets import QFormLayout, QWidget

from app.context.context import AppContext
from app.services.file_dialogs import ask_folder
from app.tools.work_dialog import WorkDialog
from app.widgets.buttons import push_button
from app.widgets.inputs import ComboBox, NumberField
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.layout import hbox, vbox
from app.widgets.naming import named
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.errors import InputError
from gelpolight_core.studies.work_precision import (
    ERRORS,
    Point,
    figure_png,
    measure_session,
    measure_virtual,
    pareto_front,
    recommended,
    write_work_precision,
)

Result = tuple[tuple[Point, ...], bytes]
HEIGHT_PX = 300


class PrecisionDialog(WorkDialog):
    """Lets the user measure error against run time on this machine.

    Parameters
    ----------
    context : AppContext
        Holds the library of calibrations.
    parent : QWidget, optional
        Owner.
    """

    def __init__(self, *, context: AppContext, parent: QWidget | None = None) -> None:
        title, start = "Error against run time", "&Measure"
        super().__init__("precision", title, start=start, context=context, parent=parent)
        self.resize(940, 660)
        self._folder: Path | None = None
        self._virtual = False
        self._make_choice()
        self._make_result()
        self._lay_out()

    @property
    def points(self) -> tuple[Point, ...]:
        """The last results."""
        return () if self.result_shown is None else self.result_shown[0]

    def _make_choice(self) -> None:
        self.calibrations = named(ComboBox(), "precision.calibration", "Calibration")
        self.calibrations.currentIndexChanged.connect(self._on_calibration)
        self.presses = named(PlainLabel(), "precision.presses", "Presses of known depth")
        self.presses.setWordWrap(True)
        tip = (
            "A session folder with presses/truth.csv and truth/*.npz, the true depth of each press"
        )
        words, text = "Choose a session folder", "Session folder…"
        self.folder = push_button(
            "precision.folder", text, self.choose_folder, accessible=words, tip=tip
        )

    def _make_result(self) -> None:
        self.figure = named(PlainLabel(), "precision.figure", "Error against time of a frame")
        self.figure.setMinimumHeight(HEIGHT_PX)
        self.figure.setAlignment(Qt.AlignmentFlag.AlignCenter)
        times = "Mode", "ms", "p95 ms"
        errors = "RMS um", "normals deg", "height %", "size %"
        self.table = self.result_table((*times, *errors, "on front"), 0)
        self.table.setMaximumHeight(170)
        self.rate = self._wish("rate", "Frames per second that are needed", " frames/s")
        self.limit = self._wish("limit", "Largest error of the depth", " um RMS")
        self.advice = named(PlainLabel(), "precision.advice", "Recommended mode")
        self.words.setMinimumHeight(2 * self.words.fontMetrics().lineSpacing())
        self.save.setToolTip(plain_tip("Table as CSV, and figure as PNG"))

    def _wish(self, name: str, label: str, suffix: str) -> NumberField:
        box = named(NumberField(decimals=1), f"precision.{name}", label, label)
        box.setRange(0.0, 10_000.0)
        box.setSpecialValueText("any")
        box.setSuffix(suffix)
        box.valueChanged.connect(self._recommend)
        return box

    def _lay_out(self) -> None:
        form = QFormLayout()
        form.addRow("Calibration", self.calibrations)
        form.addRow("Presses", hbox((self.presses, 1), self.folder))
        form.addRow("", self.button_row())
        form.addRow("I need", hbox(self.rate, self.limit, (self.advice, 1)))
        vbox(form, (self.figure, 1), self.table, self.foot_row(), of=self)

    # Inputs

    def showEvent(self, event: QShowEvent) -> None:
        """Offer the calibrations that the library contains now."""
        self._show_calibrations()
        super().showEvent(event)

    def _show_calibrations(self) -> None:
        self.calibrations.clear()
        try:
            entries = self.context.workspace.entries()
        except InputError as error:
            entries = ()
            self.say(str(error), "fail")
        for entry in entries:
            if entry.summary is not None:
                self.calibrations.addItem(entry.name, entry)
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
            self.say("There is no calibration yet. Calibrate a sensor first.", "warn")
        elif self._virtual:
            self.presses.setText("simulated by the virtual sensor")
            self.say("Measures the accuracy and run time of each mode on this machine.")
        else:
            self.presses.setText("none selected")
            self.say("Choose a session folder of this sensor that contains the true depths.")
        self.allow()

    def choose_folder(self) -> None:
        """Let the user choose a session folder with true depths."""
        settings, title = self.context.settings, "Session folder with true depths"
        if chosen := ask_folder(self, settings, "session", title):
            settings.keep_folder("session", chosen.parent)
            self.use_folder(chosen)

    def use_folder(self, folder: Path) -> None:
        """Measure on the presses of a session folder."""
        self._folder = folder
        self.presses.setText(str(folder))
        self.presses.setToolTip(plain_tip(str(folder)))
        self.allow()

    def run(self) -> None:
        """Measure in the background."""
        entry = self.calibrations.currentData()
        if entry is None or self.jobs.busy:
            return
        path, folder, design = entry.path, self._folder, self._design()

        def work(progress: Callable[[float], None]) -> Result:
            def step(_what: str, share: float) -> None:
                progress(share)

            calibration = read_calibration(path)
            if folder is not None:
                points = measure_session(folder, calibration, progress=step)
            else:
                points = measure_virtual(design, calibration, progress=step)
            return points, figure_png(points)

        self.submit("Measuring", work)

    # Results

    def show_result(self, result: Result) -> None:
        """Show the results."""
        points, png = result
        front = pareto_front(points)
        rows = []
        for point in points:
            numbers = [getattr(point, name) for name in ("median_ms", "p95_ms", *ERRORS)]
            on_front = "yes" if point in front else ""
            rows.append((point.label, *map(_digits, numbers), on_front))
        self.table.show_items(rows)
        picture = QPixmap()
        picture.loadFromData(png)
        smooth = Qt.TransformationMode.SmoothTransformation
        self.figure.setPixmap(picture.scaledToHeight(HEIGHT_PX, smooth))
        self.say("Front: no other mode is both faster and more accurate.")
        self._recommend()

    def _recommend(self) -> None:
        """Recommend a mode for the requested frame rate and error."""
        if not self.points:
            self.advice.setText("")
            return
        found = recommended(
            self.points, rate_hz=self.rate.value() or None, rms_um=self.limit.value() or None
        )
        if found is None:
            self.advice.setText("No mode on this machine is that fast and accurate")
            return
        text = f"Use: {found.label} ({_digits(found.median_ms)} ms, {_digits(found.rms_um)} um)"
        self.advice.setText(text)

    def files_of(self, result: Result, folder: Path) -> list[Path]:
        """Write the report into a folder; return the files."""
        return list(write_work_precision(result[0], folder))

    def ready(self) -> bool:
        """Whether presses with true depths are chosen."""
        chosen = self.calibrations.currentData() is not None
        return chosen and (self._virtual or self._folder is not None)


def _digits(value: float) -> str:
    """Return a number with three digits, never with an exponent."""
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"
