"""Panel next to the live image: the next press, its state, and the progress of the run."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QCheckBox, QProgressBar, QWidget

from app.measure.placing import kind_label
from app.measure.press_check import object_name
from app.widgets.buttons import Slot, push_button
from app.widgets.cells_table import Cell, CellsTable
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from gelpolight_core.measurement.evaluation_run import Outcome
from gelpolight_core.measurement.press import Press
from gelpolight_core.measurement.protocol import SAME_REGION
from gelpolight_core.measurement.protocol_run import RunProgress
from gelpolight_core.measurement.result import compare

WIDTH = 340
LIVE_LINES = 3
Measured = tuple[int, Press, Outcome]
"""Number of a press in the order of the run, and what was measured."""
BUTTONS = {
    "bare": "Capture &bare membrane",
    "capture": "&Capture now",
    "take_back": "&Repeat last press",
    "leave": "Lea&ve",
    "evaluate": "Show the &result",
}
WORDS = {
    "bare": "Capture the bare membrane and start",
    "evaluate": "Evaluate the presses so far",
}
TIPS = {
    "capture": "A steady press is captured automatically. A press that moves is refused",
    "take_back": 'The old image is moved to the folder "discarded"',
    "leave": "Every press is saved. You can continue here later",
}


class RunPanel(QWidget):
    """Shows the next press and the last ones.

    Parameters
    ----------
    slots : mapping of str to callable
        Called by the buttons: one for each of BUTTONS.
    """

    def __init__(self, slots: Mapping[str, Slot]) -> None:
        super().__init__()
        named(self, "protocol.panel", "Next press")
        self.setFixedWidth(WIDTH)
        self.title = named(PlainLabel(wrap=True), "protocol.title", "Next object")
        make_bold(self.title, size=1.35)
        self.where = named(PlainLabel(wrap=True), "protocol.where", "Position")
        self.live = named(PlainLabel(wrap=True), "protocol.live", "State of the live image")
        # Reserved space, so that nothing below moves when a text changes.
        line = self.live.fontMetrics().lineSpacing()
        for label, lines in ((self.where, 2), (self.live, LIVE_LINES)):
            label.setMinimumHeight(lines * line + 2)
            label.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.bare, self.capture, self.take_back, self.leave, self.evaluate = (
            push_button(
                f"protocol.{name}",
                text,
                slots[name],
                accessible=WORDS.get(name, ""),
                tip=TIPS.get(name, ""),
            )
            for name, text in BUTTONS.items()
        )
        self.bench = named(
            QCheckBox("&Use virtual bench"),
            "protocol.bench",
            "Let the virtual bench make the presses",
        )
        self.progress = named(QProgressBar(), "protocol.progress", "Progress of the run")
        self.progress.setTextVisible(False)
        self.counts = named(
            PlainLabel(wrap=True), "protocol.counts", "Presses done, refused and measured"
        )
        self.last = CellsTable[Measured](
            "protocol.last",
            "Presses measured, newest first",
            ("Press", "Size", "Height"),
            _cells,
            lambda measured: measured[0],
        )
        self.last.sortByColumn(0, Qt.SortOrder.DescendingOrder)
        vbox(
            *(self.title, self.where, self.live, self.bare),
            hbox(self.capture, self.take_back),
            *(self.bench, self.progress, self.counts, (self.last, 1)),
            hbox(self.leave, (self.evaluate, 1)),
            of=self,
            margins=(16, 12, 16, 12),
            spacing=8,
        )

    def show_press(self, press: Press | None, repeats: int) -> None:
        """Show the next press. None: all are done."""
        if press is None:
            self.title.setText("All presses are done")
            self.where.setText("Show the result.")
            return
        self.title.setText(object_name(press.truth))
        region = region_name(press)
        if press.region == SAME_REGION:
            region = f"{region}, press {press.repeat} of {repeats}"
        x, y = press.position_mm
        text = f"{region}: at ({x:.1f}, {y:.1f}) mm"
        if press.truth.shape == "cuboid":
            text += ", rotated as drawn"
        self.where.setText(text + ".")

    def show_live(self, sentence: str, *, good: bool = False) -> None:
        """Show the state of the live image."""
        self.live.setText(sentence)
        show_meaning(self.live, "pass" if good else "")

    def show_progress(self, progress: RunProgress, measured: Mapping[Press, Outcome]) -> None:
        """Show the progress of the run, and what was measured."""
        self.progress.setRange(0, progress.total)
        self.progress.setValue(progress.done)
        text = f"{progress.done} of {progress.total} presses, {len(measured)} measured"
        if progress.refused:
            text += f", {progress.refused} refused"
        if progress.object_total:
            text += f"\nThis object: {progress.object_done} of {progress.object_total}"
        self.counts.setText(text)
        self.take_back.setEnabled(progress.done > 0)
        self.evaluate.setEnabled(progress.done > 0)
        rows = [(number, *item) for number, item in enumerate(measured.items())]
        self.last.show_items(rows)


def _cells(measured: Measured) -> tuple[Cell, ...]:
    number, press, outcome = measured
    name = (
        f"{kind_label(press.truth.shape)} {press.truth.size_mm:g} x "
        f"{press.truth.height_mm:g}, {region_name(press).lower()}"
    )
    if isinstance(outcome, str):
        doubt, texts = outcome, ["not measured", ""]
    else:
        doubt = outcome.reason
        texts = [f"{q.error_percent:+.1f} %" for q in compare(outcome, press.truth)]
    role = "warn" if doubt else ""
    cells = (Cell(text, role=role, tip=doubt, key=number, right=True) for text in texts)
    return (Cell(name, role=role, tip=doubt or name, key=number), *cells)


def region_name(press: Press) -> str:
    """Return the name of a press's region for the user."""
    if press.region == SAME_REGION:
        return "Same region"
    return "Random region {n}".format(n=press.region.removeprefix("r").lstrip("0"))
