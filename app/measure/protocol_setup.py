"""Set-up of an evaluation run: sensor, objects, number of presses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QFormLayout,
    QGroupBox,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from app.measure.placing import kind_label
from app.widgets.buttons import push_button
from app.widgets.inputs import ComboBox, SpinBox
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
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


class ProtocolSetup(QScrollArea):
    """Asks which objects to press, and offers unfinished runs.

    Parameters
    ----------
    on_begin, on_run : callable
        Called with the file of the calibration for a new run, and with the folder of a run to
        continue.
    """

    def __init__(
        self, *, on_begin: Callable[[Path], object], on_run: Callable[[Path], object]
    ) -> None:
        super().__init__()
        named(self, "protocol.setup", tr("Set up the evaluation protocol"))
        self.setWidgetResizable(True)
        self.setFrameShape(QScrollArea.Shape.NoFrame)
        self._on_begin, self._on_run = on_begin, on_run
        self._no_runs = PlainLabel(
            tr("None yet. You can leave a run at any press and continue it later."), wrap=True
        )
        self._no_runs.setFixedWidth(320)
        self._runs = vbox()
        runs = vbox(_heading(tr("Runs so far")), self._no_runs, self._runs, None)
        inside = QWidget()
        hbox(None, self._build_form(), runs, None, of=inside, margins=(24, 20, 24, 20), spacing=36)
        self.setWidget(inside)
        self._count()

    def _build_form(self) -> QVBoxLayout:
        explanation = PlainLabel(
            tr(
                "Press cylinders and cuboids of known size, in one region and in random "
                "regions. The program shows the position, captures each press "
                "automatically when it is steady, and compares the measured values with "
                "the true ones."
            ),
            wrap=True,
        )
        self.calibration = named(
            ComboBox(), "protocol.calibration", tr("Sensor and calibration to evaluate")
        )
        self.calibration.setSizeAdjustPolicy(
            QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
        )
        self.calibration.setMinimumContentsLength(36)
        top = QFormLayout()
        top.addRow(tr("Sensor, calibration"), self.calibration)
        shapes, self.shapes = self._choices(
            "shape", tr("Shapes"), {name: kind_label(name) for name in PAPER.shapes}
        )
        sizes, self.sizes = self._choices(
            "size",
            tr("Diameters or sides, at a height of {h:g} mm").format(h=PAPER.at_height_mm),
            {size: tr("{x:g} mm").format(x=size) for size in PAPER.sizes_mm},
        )
        heights, self.heights = self._choices(
            "height",
            tr("Heights, at a diameter or side of {s:g} mm").format(s=PAPER.at_size_mm),
            {height: tr("{x:g} mm").format(x=height) for height in PAPER.heights_mm},
        )
        counts = QFormLayout()
        self.repeats, self.regions = (
            self._number(counts, name, label, value)
            for name, label, value in (
                ("repeats", tr("Presses in the same region"), PAPER.repeats),
                ("regions", tr("Random regions, one press each"), PAPER.regions),
            )
        )
        self.summary = named(
            PlainLabel(wrap=True), "protocol.summary", tr("Number of objects and presses, and time")
        )
        self.begin = push_button(
            "protocol.begin",
            tr("&Start"),
            lambda: self._on_begin(Path(self.calibration.currentData())),
            accessible=tr("Start the run"),
        )
        self.begin.setMinimumHeight(40)
        self.problem = named(
            PlainLabel(wrap=True), "protocol.problem", tr("Why the run was not started")
        )
        show_meaning(self.problem, "fail")
        for label in (explanation, self.problem):
            label.setFixedWidth(WIDTH)
        return vbox(
            _heading(tr("Evaluate a sensor")),
            explanation,
            top,
            shapes,
            sizes,
            heights,
            counts,
            self.summary,
            self.begin,
            self.problem,
            None,
            spacing=10,
        )

    def _choices(
        self, kind: str, title: str, choices: Mapping[T, str]
    ) -> tuple[QGroupBox, dict[T, QCheckBox]]:
        """Return a group of check boxes, one for each choice."""
        boxes = {
            value: named(QCheckBox(text), f"protocol.{kind}.{value}", f"{title}: {text}")
            for value, text in choices.items()
        }
        for box in boxes.values():
            box.setChecked(True)
            box.toggled.connect(self._count)
        group = named(QGroupBox(title), f"protocol.{kind}s", title)
        hbox(*boxes.values(), None, of=group)
        return group, boxes

    def _number(self, form: QFormLayout, name: str, label: str, value: int) -> SpinBox:
        box = named(SpinBox(maximum=99, value=value), f"protocol.{name}", label)
        box.setAlignment(Qt.AlignmentFlag.AlignRight)
        box.setFixedWidth(90)
        box.valueChanged.connect(self._count)
        form.addRow(label, box)
        return box

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

    def show_runs(self, runs: Mapping[Path, str]) -> None:
        """Offer these runs: their folders, and what they are."""
        while self._runs.count():
            old = self._runs.takeAt(0).widget()
            if old is not None:
                old.setObjectName("")
                old.deleteLater()
        self._no_runs.setVisible(not runs)
        for number, (folder, text) in enumerate(list(runs.items())[:MOST_RUNS]):
            button = push_button(
                f"protocol.run.{number}",
                text,
                lambda folder=folder: self._on_run(folder),
                accessible=tr("Continue {run}").format(run=text.replace("\n", ", ")),
                tip=str(folder),
            )
            button.setFixedWidth(320)
            button.setStyleSheet("text-align: left; padding: 6px;")
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


def _chosen(boxes: Mapping[T, QCheckBox]) -> tuple[T, ...]:
    return tuple(value for value, box in boxes.items() if box.isChecked())
