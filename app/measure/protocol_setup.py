"""Set-up of an evaluation run: sensor, objects, number of presses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QAbstractItemView,
    QComboBox,
    QFormLayout,
    QListWidget,
    QListWidgetItem,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from app.measure.placing import kind_label
from app.widgets.buttons import push_button
from app.widgets.forms import Form
from app.widgets.inputs import ComboBox
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.meaning import heading, show_meaning
from app.widgets.naming import named
from app.workspace.entries import Entry
from gelpolight_core.fields import choice, number
from gelpolight_core.measurement.protocol import SHAPES, Protocol
from gelpolight_core.measurement.statistics import too_few

WIDTH = 480
RUNS_WIDTH = 300
MOST_RUNS = 8
SECONDS_A_PRESS = 20
"""Time of a practised user per press, including lifting and positioning."""
PAPER = Protocol()
OBJECT = Qt.ItemDataRole.UserRole


@dataclass(frozen=True, slots=True)
class Presses:
    """How often the objects are pressed."""

    shape: str = choice(
        "", "Shapes", {"": "Cylinders and cuboids", **{s: kind_label(s) for s in SHAPES}}
    )
    repeats: int = number(PAPER.repeats, "Presses in the same region", 0, 99)
    regions: int = number(PAPER.regions, "Random regions, one press each", 0, 99)


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
        named(self, "protocol.setup", "Set up the evaluation protocol")
        self.setWidgetResizable(True)
        self.setFrameShape(QScrollArea.Shape.NoFrame)
        self._on_begin, self._on_run = on_begin, on_run
        self._no_runs = PlainLabel(
            "None yet. You can leave a run at any press and continue it later.", wrap=True
        )
        self._no_runs.setFixedWidth(RUNS_WIDTH)
        self._runs = [
            push_button(f"protocol.run.{number}", "", partial(self._open, number))
            for number in range(MOST_RUNS)
        ]
        self._folders: list[Path] = []
        for button in self._runs:
            button.setFixedWidth(RUNS_WIDTH)
            button.setStyleSheet("text-align: left")
        runs = vbox(heading("Runs so far", size=1.45), self._no_runs, *self._runs, None)
        inside = QWidget()
        hbox(None, self._build_form(), runs, None, of=inside, margins=(24, 16, 24, 16), spacing=32)
        self.setWidget(inside)
        self._count()

    def _build_form(self) -> QVBoxLayout:
        explanation = PlainLabel(
            (
                "Press cylinders and cuboids of known size, in one region and in random "
                "regions. The program shows the position, captures each press "
                "automatically when it is steady, and compares the measured values with "
                "the true ones."
            ),
            wrap=True,
        )
        self.calibration = named(
            ComboBox(), "protocol.calibration", "Sensor and calibration to evaluate"
        )
        self.calibration.setSizeAdjustPolicy(
            QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
        )
        top = QFormLayout()
        top.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        top.addRow("Sensor, calibration", self.calibration)
        self.objects = named(QListWidget(), "protocol.objects", "Objects")
        self.objects.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        for truth in PAPER.objects[: len(PAPER.objects) // len(PAPER.shapes)]:
            text = "{size:g} mm, height {height:g} mm"
            item = QListWidgetItem(text.format(size=truth.size_mm, height=truth.height_mm))
            item.setData(OBJECT, [truth.size_mm, truth.height_mm])
            self.objects.addItem(item)
        self.objects.selectAll()
        self.objects.setFixedHeight(
            self.objects.count() * self.objects.sizeHintForRow(0) + 2 * self.objects.frameWidth()
        )
        self.objects.itemSelectionChanged.connect(self._count)
        hint = PlainLabel("Click one, or several with Ctrl. Ctrl+A chooses all.", wrap=True)
        show_meaning(hint, "muted")
        top.addRow("Diameter or side", vbox(self.objects, hint, spacing=2))
        self.presses = Form(Presses(), "protocol")
        self.presses.changed.connect(lambda _name, _value: self._count())
        self.summary = named(
            PlainLabel(wrap=True), "protocol.summary", "Number of objects and presses, and time"
        )
        self.begin = push_button(
            "protocol.begin",
            "&Start",
            lambda: self._on_begin(Path(self.calibration.currentData())),
            accessible="Start the run",
        )
        self.begin.setProperty("primary", True)
        self.problem = named(
            PlainLabel(wrap=True), "protocol.problem", "Why the run was not started"
        )
        show_meaning(self.problem, "fail")
        for label in (explanation, self.problem):
            label.setFixedWidth(WIDTH)
        return vbox(
            heading("Evaluate a sensor", size=1.45),
            explanation,
            top,
            self.presses,
            self.summary,
            self.begin,
            self.problem,
            None,
            spacing=8,
        )

    def protocol(self) -> Protocol:
        """Return the chosen settings."""
        chosen = [item.data(OBJECT) for item in self.objects.selectedItems()]
        presses = self.presses.value
        return Protocol(
            shapes=(presses.shape,) if presses.shape else PAPER.shapes,
            sizes_mm=tuple(sorted(size for size, h in chosen if h == PAPER.at_height_mm)),
            heights_mm=tuple(sorted(height for s, height in chosen if s == PAPER.at_size_mm)),
            repeats=presses.repeats,
            regions=presses.regions,
        )

    def show_entries(self, entries: Sequence[Entry]) -> None:
        """Offer these calibrations. The one in use is preselected, unless another was chosen."""
        before = self.calibration.currentData()
        self.calibration.clear()
        good = [entry for entry in entries if entry.summary is not None]
        for entry in sorted(good, key=lambda e: not e.in_use):
            note = " (in use)" if entry.in_use else ""
            self.calibration.addItem(f"{entry.serial}: {entry.name}{note}", str(entry.path))
        self.calibration.setCurrentIndex(max(self.calibration.findData(before), 0) if good else -1)
        self._count()

    def show_runs(self, runs: Mapping[Path, str]) -> None:
        """Offer these runs: their folders, and what they are."""
        self._folders = list(runs)
        self._no_runs.setVisible(not runs)
        texts = [*runs.values(), *([""] * MOST_RUNS)]
        for button, text in zip(self._runs, texts, strict=False):
            button.setVisible(bool(text))
            button.setText(text)
            run = text.replace("\n", ", ")
            button.setAccessibleName(f"Continue {run}")

    def _open(self, number: int) -> None:
        self._on_run(self._folders[number])

    def show_problem(self, sentence: str) -> None:
        """Show why the run was not started. Empty: no error."""
        self.problem.setText(sentence)

    def _count(self) -> None:
        """Show the total of the settings, and enable the start if it is not empty."""
        protocol = self.protocol()
        count = len(protocol.presses())
        if not self.calibration.count():
            text = "There is no calibration in the library. Calibrate a sensor first."
        elif not count:
            text = "Choose an object and the number of presses."
        else:
            text = (
                f"Objects: {len(protocol.objects)}. Presses: {count}, about "
                f"{_duration(count * SECONDS_A_PRESS)} by hand."
            )
            if few := too_few(protocol.missing_repeats):
                text += "\n" + f"Repeatability: {few}"
        self.summary.setText(text)
        self.begin.setEnabled(bool(count and self.calibration.count()))


def _duration(seconds: float) -> str:
    if seconds < 90.0 * 60.0:
        return f"{max(round(seconds / 60.0), 1)} min"
    return f"{seconds / 3600.0:.1f} hours"
