"""Set-up of an evaluation run: sensor, objects, number of presses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QFormLayout,
    QGroupBox,
    QHBoxLayout,
    QPushButton,
    QScrollArea,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from app.widgets.inputs import ComboBox, SpinBox
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from app.workspace.entries import Entry
from gelpolight_core.measurement.protocol import Protocol
from gelpolight_core.translation import tr

T = TypeVar("T")

WIDTH = 520
MOST_RUNS = 8
SECONDS_A_PRESS = 20
"""Time of a practised user per press, including lifting and positioning."""
PAPER = Protocol()


@dataclass(frozen=True, slots=True)
class KnownRun:
    """A run that can be continued.

    Attributes
    ----------
    folder : Path
        Its folder.
    text : str
        Text for the user: sensor, date, progress.
    """

    folder: Path
    text: str


class ProtocolSetup(QScrollArea):
    """Asks which objects to press, and offers unfinished runs.

    Signals
    -------
    begin_wanted(str)
        Start a new run with the calibration in this file.
    run_wanted(str)
        Continue the run in this folder.
    """

    begin_wanted = Signal(str)
    run_wanted = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        named(self, "protocol.setup", tr("Set up the evaluation protocol"))
        self.setWidgetResizable(True)
        self.setFrameShape(QScrollArea.Shape.NoFrame)
        inside = QWidget()
        self.setWidget(inside)
        form, runs = QVBoxLayout(), QVBoxLayout()
        hbox(None, form, runs, None, of=inside, margins=(24, 20, 24, 20), spacing=36)
        self._build_form(form)
        self._build_runs(runs)
        self._count()

    def _build_form(self, column: QVBoxLayout) -> None:
        column.setSpacing(10)
        column.addWidget(_heading(tr("Evaluate a sensor")))
        explanation = PlainLabel(
            tr(
                "Press cylinders and cuboids of known size, in one region and in random "
                "regions. The program shows the position, captures each press "
                "automatically when it is steady, and compares the measured values with "
                "the true ones."
            )
        )
        explanation.setWordWrap(True)
        explanation.setFixedWidth(WIDTH)
        column.addWidget(explanation)
        top = QFormLayout()
        self.calibration = named(
            ComboBox(), "protocol.calibration", tr("Sensor and calibration to evaluate")
        )
        self.calibration.setSizeAdjustPolicy(
            QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
        )
        self.calibration.setMinimumContentsLength(36)
        top.addRow(tr("Sensor, calibration"), self.calibration)
        column.addLayout(top)
        self.shapes = _choices(
            "shape",
            tr("Shapes"),
            {"cylinder": tr("Cylinder"), "cuboid": tr("Cuboid")},
            column,
            self._count,
        )
        self.sizes = _choices(
            "size",
            tr("Diameters or sides, at a height of {h:g} mm").format(h=PAPER.at_height_mm),
            {size: tr("{x:g} mm").format(x=size) for size in PAPER.sizes_mm},
            column,
            self._count,
        )
        self.heights = _choices(
            "height",
            tr("Heights, at a diameter or side of {s:g} mm").format(s=PAPER.at_size_mm),
            {height: tr("{x:g} mm").format(x=height) for height in PAPER.heights_mm},
            column,
            self._count,
        )
        counts = QFormLayout()
        self.repeats = _number("repeats", tr("Presses in the same region"), PAPER.repeats)
        self.regions = _number("regions", tr("Random regions, one press each"), PAPER.regions)
        for label, box in (
            (tr("Presses in the same region"), self.repeats),
            (tr("Random regions, one press each"), self.regions),
        ):
            box.valueChanged.connect(self._count)
            counts.addRow(label, box)
        column.addLayout(counts)
        self.summary = named(
            PlainLabel(), "protocol.summary", tr("Number of objects and presses, and time")
        )
        self.summary.setWordWrap(True)
        column.addWidget(self.summary)
        self.begin = named(QPushButton(tr("&Start")), "protocol.begin", tr("Start the run"))
        self.begin.setMinimumHeight(40)
        self.begin.clicked.connect(lambda: self.begin_wanted.emit(self.calibration.currentData()))
        column.addWidget(self.begin)
        self.problem = named(PlainLabel(), "protocol.problem", tr("Why the run was not started"))
        self.problem.setWordWrap(True)
        show_meaning(self.problem, "fail")
        self.problem.setFixedWidth(WIDTH)
        column.addWidget(self.problem)
        column.addStretch(1)

    def _build_runs(self, column: QVBoxLayout) -> None:
        column.addWidget(_heading(tr("Runs so far")))
        self._no_runs = PlainLabel(
            tr("None yet. You can leave a run at any press and continue it later.")
        )
        self._no_runs.setWordWrap(True)
        self._no_runs.setFixedWidth(320)
        column.addWidget(self._no_runs)
        self._runs = QVBoxLayout()
        column.addLayout(self._runs)
        column.addStretch(1)

    def protocol(self) -> Protocol:
        """Return the chosen settings."""
        return Protocol(
            shapes=_chosen(self.shapes),
            sizes_mm=_chosen(self.sizes),
            heights_mm=_chosen(self.heights),
            repeats=self.repeats.value(),
            regions=self.regions.value(),
        )

    def show_entries(self, entries: Sequence[Entry]) -> None:
        """Offer these calibrations. The one in use is preselected, unless another was chosen."""
        before = self.calibration.currentData()
        self.calibration.clear()
        good = [entry for entry in entries if entry.summary is not None]
        for entry in sorted(good, key=lambda e: not e.in_use):
            note = tr(" (in use)") if entry.in_use else ""
            self.calibration.addItem(f"{entry.serial}: {entry.name}{note}", str(entry.path))
        self.calibration.setCurrentIndex(max(self.calibration.findData(before), 0) if good else -1)
        self._count()

    def show_runs(self, runs: Sequence[KnownRun]) -> None:
        """Offer these runs."""
        while self._runs.count():
            old = self._runs.takeAt(0).widget()
            if old is not None:
                old.setObjectName("")
                old.deleteLater()
        self._no_runs.setVisible(not runs)
        for number, run in enumerate(runs[:MOST_RUNS]):
            button = named(
                QPushButton(run.text),
                f"protocol.run.{number}",
                tr("Continue {run}").format(run=run.text.replace("\n", ", ")),
                str(run.folder),
            )
            button.setFixedWidth(320)
            button.setStyleSheet("text-align: left; padding: 6px;")
            button.clicked.connect(lambda _=False, f=run.folder: self.run_wanted.emit(str(f)))
            self._runs.addWidget(button)

    def show_problem(self, sentence: str) -> None:
        """Show why the run was not started. Empty: no error."""
        self.problem.setText(sentence)

    def _count(self) -> None:
        """Show the total of the settings, and enable the start if it is not empty."""
        protocol = self.protocol()
        count = len(protocol.presses())
        if not self.calibration.count():
            text = tr("There is no calibration in the library. Calibrate a sensor first.")
        elif not count:
            text = tr("Choose a shape, a size or height, and the number of presses.")
        else:
            text = tr("Objects: {objects}. Presses: {n}, about {time} by hand.").format(
                objects=len(protocol.objects), n=count, time=_duration(count * SECONDS_A_PRESS)
            )
        self.summary.setText(text)
        self.begin.setEnabled(bool(count and self.calibration.count()))


def _duration(seconds: float) -> str:
    if seconds < 90.0 * 60.0:
        return tr("{n} min").format(n=max(round(seconds / 60.0), 1))
    return tr("{n:.1f} hours").format(n=seconds / 3600.0)


def _heading(text: str) -> PlainLabel:
    label = PlainLabel(text)
    make_bold(label, size=1.45)
    return label


def _choices(
    kind: str,
    title: str,
    choices: Mapping[T, str],
    column: QVBoxLayout,
    changed: Callable[[], None],
) -> dict[T, QCheckBox]:
    """Return check boxes, one for each choice, in their own group box."""
    group = named(QGroupBox(title), f"protocol.{kind}s", title)
    row = QHBoxLayout(group)
    boxes = {}
    for value, text in choices.items():
        box = named(QCheckBox(text), f"protocol.{kind}.{value}", f"{title}: {text}")
        box.setChecked(True)
        box.toggled.connect(changed)
        row.addWidget(box)
        boxes[value] = box
    row.addStretch(1)
    column.addWidget(group)
    return boxes


def _chosen(boxes: Mapping[T, QCheckBox]) -> tuple[T, ...]:
    return tuple(value for value, box in boxes.items() if box.isChecked())


def _number(name: str, accessible: str, value: int) -> QSpinBox:
    box = named(SpinBox(), f"protocol.{name}", accessible)
    box.setRange(0, 99)
    box.setValue(value)
    box.setAlignment(Qt.AlignmentFlag.AlignRight)
    box.setFixedWidth(90)
    return box
