"""The choice between accuracy and speed: which model, and how much work a frame is worth."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from statistics import median

from PySide6.QtCore import QObject, QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import QComboBox, QWidget

from app.inspect.products import Shown
from app.shell.context import AppContext
from app.shell.jobs import Job, Jobs
from app.widgets.label import plain_tip
from app.widgets.naming import named
from gelpolight_core.reconstruction.efforts import FOUND, FULL, PAPER, WAYS, Way
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.translation import tr

WIDTH_CHARACTERS = 32
TIMED = 15
"""Frames that a time is the median of."""


class WayBox(QComboBox):
    """The ways to reconstruct, each with its error and its time."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        named(
            self,
            "inspect.way",
            tr("Accuracy and speed"),
            tr(
                "Accuracy or speed. Beside each name: errors of height and of size that were\n"
                "measured on a rendered sensor, and the time of a frame on this machine, once\n"
                "it was tried. A standing picture has all of its model's accuracy."
            ),
        )
        self.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.setMinimumContentsLength(WIDTH_CHARACTERS)
        self.setEnabled(False)

    def show_ways(self, ways: tuple[Way, ...], chosen: Way | None) -> None:
        """Offer these; none: there is no calibration to choose for."""
        with QSignalBlocker(self):
            self.clear()
            for way in ways:
                self.addItem("", way)
            self.setCurrentIndex(ways.index(chosen) if chosen in ways else -1)
        self.setEnabled(len(ways) > 1)
        self.show_times({})

    def show_times(self, times_ms: Mapping[Way, float]) -> None:
        """Write beside each way what it took."""
        for index in range(self.count()):
            text = way_text(self.itemData(index), times_ms.get(self.itemData(index)))
            if text != self.itemText(index):
                self.setItemText(index, text)
                self.setItemData(index, plain_tip(text), Qt.ItemDataRole.ToolTipRole)
        widest = max((self.view().sizeHintForColumn(0), self.width()))
        self.view().setMinimumWidth(widest)


class WayChoice(QObject):
    """Makes of a calibration's reconstructors those of the way that a person chose.

    Parameters
    ----------
    jobs : Jobs
        Make ready what takes long.
    parent : QObject
        Owner.
    context : AppContext
        With the settings, which remember the choice.

    Signals
    -------
    chosen(object, object)
        Reconstructors for live and for standing pictures, or None.
    """

    chosen = Signal(object, object)

    def __init__(self, jobs: Jobs, parent: QObject, *, context: AppContext) -> None:
        super().__init__(parent)
        self._jobs, self._context = jobs, context
        self.box = WayBox()
        self.box.activated.connect(self._on_chosen)
        self._live: Reconstructor | None = None
        self._best: Reconstructor | None = None
        self._paper: Reconstructor | None = None
        self._times: dict[Way, deque[float]] = {}
        self._last: Shown | None = None

    @property
    def way(self) -> Way:
        """The way of the settings; where there is no such, the usual one."""
        kept = Way(*self._context.settings.reconstruction)
        return kept if kept in WAYS else Way()

    def take(self, live: Reconstructor | None, best: Reconstructor | None) -> None:
        """Offer what a calibration can do, and go on with what was chosen before."""
        self._live, self._best = live, best
        self._paper = live if live is not None and live.model == PAPER else None
        self._times.clear()
        ways = () if live is None else WAYS
        if self._paper is not None:
            ways = tuple(way for way in WAYS if way.model == PAPER)
        self.box.show_ways(ways, self.way if self.way in ways else next(reversed(ways), None))
        self._choose()

    def follow(self, shown: Shown | None) -> None:
        """Note how long a frame took; the same is noted once."""
        heightmap = None if shown is None else shown.heightmap
        if shown is None or shown is self._last or heightmap is None or heightmap.plan is None:
            return
        self._last = shown
        if heightmap.depth_sd_mm is None:  # that would be another, longer work
            way = Way(heightmap.model, heightmap.plan.effort if heightmap.model == FULL else "best")
            self._times.setdefault(way, deque(maxlen=TIMED)).append(shown.depth_ms)
            if not self.box.view().isVisible():
                self.box.show_times({way: median(ms) for way, ms in self._times.items()})

    def close(self) -> None:
        """Let the reconstructors go."""
        self._live = self._best = self._paper = None

    def _on_chosen(self, index: int) -> None:
        way = self.box.itemData(index)
        self._context.settings.reconstruction = (way.model, way.effort)
        self._choose()

    def _choose(self) -> None:
        way, live, best = self.box.currentData(), self._live, self._best
        if live is None or way is None:
            self.chosen.emit(None, None)
        elif way.model == FULL:
            self.chosen.emit(best if way.effort == "best" else live.at_effort(way.effort), best)
        elif self._paper is not None:
            self.chosen.emit(self._paper, self._paper)
        else:
            self.chosen.emit(live, best)  # until the other is ready
            self._make_paper(live)

    def _make_paper(self, live: Reconstructor) -> None:
        def work(tell: Callable[[float], None]) -> Reconstructor:
            tell(0.1)
            made = Reconstructor(live.calibration, model=PAPER)
            made.warm_up()
            return made

        def done(made: Reconstructor) -> None:
            if self._live is live:
                self._paper = made
                self._choose()

        self._jobs.submit(Job(tr("Getting the paper's model ready"), work, done))


def way_text(way: Way, milliseconds: float | None) -> str:
    """Return a way's name with its errors, and its time where that is known."""
    found = FOUND[way]
    height, size = found.height_percent, found.size_percent
    decimals = 2 if max(height, size) < 1.0 else 1
    parts = [way.label, f"{height:.{decimals}f} / {size:.{decimals}f} %"]
    if milliseconds is not None:
        parts.append(tr("{ms:.0f} ms").format(ms=milliseconds))
    return "   ".join(parts)
