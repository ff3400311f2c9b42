"""The choice between accuracy and speed: model and effort."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from statistics import median

from PySide6.QtCore import QObject, QSignalBlocker, Qt

from app.live.frame_processor import FrameResult
from app.program.context import AppContext
from app.program.jobs import BackgroundJob, JobQueue
from app.widgets.inputs import ComboBox
from app.widgets.label import plain_tip
from app.widgets.widget_names import set_names
from gelpolight_core.reconstruction.modes import FOUND, MODES_OF, PAPER, Mode
from gelpolight_core.reconstruction.reconstructor import Reconstructor

TIMED = 15
"""Number of frames for the median time."""


class ModeBox(ComboBox):
    """List of the reconstruction modes with their measured error and speed."""

    def __init__(self) -> None:
        super().__init__(characters=20)
        set_names(
            self,
            "inspect.mode",
            "Accuracy and speed",
            (
                "Choose accuracy or speed. In brackets: images per second on this machine, once\n"
                "the mode has been used, and the error of heights and sizes on a simulated matt\n"
                "sensor. The error of your own sensor is on the page Sensors. A frozen image\n"
                "always has the full accuracy of its model."
            ),
        )
        self.setEnabled(False)

    def show_modes(self, modes: tuple[Mode, ...], selected: Mode | None) -> None:
        """Offer these modes. None: there is no calibration."""
        with QSignalBlocker(self):
            self.clear()
            for mode in modes:
                self.addItem("", mode)
            self.setCurrentIndex(modes.index(selected) if selected in modes else -1)
        self.setEnabled(len(modes) > 1)
        self.show_times({})

    def show_times(self, times_ms: Mapping[Mode, float]) -> None:
        """Write the measured times next to the modes."""
        for index in range(self.count()):
            text = mode_text(self.itemData(index), times_ms.get(self.itemData(index)))
            if text != self.itemText(index):
                self.setItemText(index, text)
                self.setItemData(index, plain_tip(text), Qt.ItemDataRole.ToolTipRole)
        widest = max((self.view().sizeHintForColumn(0), self.width()))
        self.view().setMinimumWidth(widest)


class ModeChoice(QObject):
    """Makes the reconstructors of the mode that the user selected.

    Parameters
    ----------
    jobs : JobQueue
        Runs slow preparation.
    parent : QObject
        Owner.
    on_chosen : callable
        Called with the reconstructors for live and for frozen images, or None.
    context : AppContext
        Holds the settings, which store the mode.
    """

    def __init__(
        self,
        jobs: JobQueue,
        parent: QObject,
        on_chosen: Callable[[Reconstructor | None, Reconstructor | None], object],
        *,
        context: AppContext,
    ) -> None:
        super().__init__(parent)
        self._chosen = on_chosen
        self._jobs, self._context = jobs, context
        self.box = ModeBox()
        self.box.activated.connect(self._on_chosen)
        context.requests.preferences_changed.connect(self._follow_settings)
        self._live: Reconstructor | None = None
        self._best: Reconstructor | None = None
        self._paper: Reconstructor | None = None
        self._times: dict[Mode, deque[float]] = {}
        self._last: FrameResult | None = None

    @property
    def mode(self) -> Mode:
        """The mode in the settings, or the default if that one is not available."""
        return self._context.settings.preferences.mode

    def offer(self, live: Reconstructor | None, best: Reconstructor | None) -> None:
        """Offer the modes of a calibration, and continue with the mode selected before."""
        self._live, self._best, self._paper = live, best, None
        self._times.clear()
        modes = () if live is None else MODES_OF[live.model]
        self.box.show_modes(modes, self.mode if self.mode in modes else next(reversed(modes), None))
        self._choose()

    def follow(self, result: FrameResult | None) -> None:
        """Note the processing time of a frame, once per frame."""
        heightmap = None if result is None else result.heightmap
        if result is None or result is self._last or heightmap is None or heightmap.trace is None:
            return
        self._last = result
        if heightmap.depth_sd_mm is None:  # a frame with other, longer work
            mode = Mode(heightmap.model, heightmap.trace.effort)
            self._times.setdefault(mode, deque(maxlen=TIMED)).append(result.depth_ms)
            if not self.box.view().isVisible():
                self.box.show_times({mode: median(ms) for mode, ms in self._times.items()})

    def close(self) -> None:
        """Release the reconstructors."""
        self._live = self._best = self._paper = None

    def _on_chosen(self, index: int) -> None:
        mode = self.box.itemData(index)
        self._context.settings.prefer(reconstruction=f"{mode.model}/{mode.effort}")
        self._choose()

    def _follow_settings(self) -> None:
        offered = [self.box.itemData(index) for index in range(self.box.count())]
        if self.mode in offered and self.mode != self.box.currentData():
            self.box.setCurrentIndex(offered.index(self.mode))
            self._choose()

    def _choose(self) -> None:
        mode, live, best = self.box.currentData(), self._live, self._best
        if live is None or mode is None:
            self._chosen(None, None)
        elif mode.model == live.model:
            self._chosen(best if mode.effort == "best" else live.at_effort(mode.effort), best)
        elif self._paper is not None:
            self._chosen(self._paper, self._paper)
        else:
            self._chosen(live, best)  # until the other one is ready
            self._make_paper(live)

    def _make_paper(self, live: Reconstructor) -> None:
        def work(progress: Callable[[float], None]) -> Reconstructor:
            progress(0.1)
            paper = Reconstructor(live.calibration, model=PAPER)
            paper.warm_up()
            return paper

        def done(paper: Reconstructor) -> None:
            if self._live is live:
                self._paper = paper
                self._choose()

        self._jobs.submit(BackgroundJob("Preparing the paper's model", work, done))


def mode_text(mode: Mode, milliseconds: float | None) -> str:
    """Return what a mode means: its name, the images per second, and the error of a height."""
    error, parts = FOUND.get(mode), []
    if milliseconds:
        parts.append(f"{1e3 / milliseconds:.0f}/s")
    if error is not None:  # else the calibration's quality table states it
        parts.append(f"±{max(error.height_percent, error.size_percent):.1f} %")
    return f"{mode.label} ({', '.join(parts)})" if parts else mode.label
