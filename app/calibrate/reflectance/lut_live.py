"""The panel next to the editor: the effect of the edit on a ball press, before and after."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import PurePath

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import QWidget

from app.calibrate.reflectance.lut_effect import Effect
from app.calibrate.reflectance.lut_model import CurveEdit
from app.services.newest_wins import NewestWins
from app.theme import theme
from app.widgets.inputs import ComboBox
from app.widgets.label import PlainLabel
from app.widgets.layout import vbox
from app.widgets.naming import named
from app.widgets.plots import without_menus
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

UM = 1000.0


class LivePanel(QWidget):
    """Shows the profile of a press and its error, for the initial and the present state.

    Parameters
    ----------
    before : CurveEdit
        The state to compare with.
    presses : sequence of str
        Names of the presses to choose from.
    effect : callable
        From (state, name of press) to :class:`Effect`; called in a separate thread.
    """

    def __init__(
        self,
        before: CurveEdit,
        presses: Sequence[str],
        effect: Callable[[CurveEdit, str], Effect],
    ) -> None:
        super().__init__()
        self.setMinimumWidth(250)
        self._start = self._state = before
        self._before: dict[str, Effect] = {}
        self._worker: NewestWins[tuple[CurveEdit, str], tuple[Effect, Effect]] = NewestWins(
            lambda request: self._both(effect, *request), name="lut-effect"
        )
        self._timer = QTimer(self, interval=30)
        self._timer.timeout.connect(self._poll)
        self.press = named(
            ComboBox(), "lut.press", tr("Ball press to show"), tr("Ball press to show")
        )
        for name in presses:
            self.press.addItem(PurePath(name).name, name)
        self.press.currentIndexChanged.connect(self._ask)
        self._words = named(PlainLabel(wrap=True), "lut.effect", tr("Effect on the press"))
        self._words.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._words.setMinimumHeight(5 * self.fontMetrics().lineSpacing())
        self._profile = named(_bare_plot(), "lut.profile", tr("Depth through the ball's centre"))
        self._residual = named(_bare_plot(), "lut.residual", tr("Depth minus ball"))
        self._lines = self._make_lines()
        title = PlainLabel(tr("Effect of the edit on a press"), wrap=True)
        title.setBuddy(self.press)
        vbox(
            title,
            self.press,
            self._words,
            (self._profile, 3),
            (self._residual, 2),
            of=self,
            margins=0,
        )
        self.apply_theme()

    def show_plots(self, on: bool) -> None:
        """Show the profile and its residual, or only the words."""
        self._profile.setVisible(on)
        self._residual.setVisible(on)

    def show_state(self, edit: CurveEdit) -> None:
        """Request the effect of a state; an older request without a result is dropped."""
        self._state = edit
        self._ask()

    def stop(self) -> bool:
        """Stop the thread; return whether it has stopped."""
        self._timer.stop()
        return self._worker.stop(timeout_s=5.0)

    def apply_theme(self) -> None:
        """Apply the colours of the present theme."""
        text = theme.colour("text")
        for plot in (self._profile, self._residual):
            plot.setBackground(theme.colour("base"))
            for side in ("bottom", "left"):
                plot.getAxis(side).setPen(pg.mkPen(theme.colour("muted")))
                plot.getAxis(side).setTextPen(pg.mkPen(text))
        self._legend.setLabelTextColor(text)
        for _, label in self._legend.items:
            label.setText(label.text)  # otherwise it keeps the old colour
        stale = pg.mkPen(theme.colour("stale"), width=2, style=Qt.PenStyle.DashDotLine)
        accent = pg.mkPen(theme.colour("accent"), width=2.5)
        ball = pg.mkPen(text, width=1.5, style=Qt.PenStyle.DotLine)
        pens = {"ball": ball, "before": stale, "after": accent, "off0": stale, "off1": accent}
        for name, pen in pens.items():
            self._lines[name].setPen(pen)
        self._zero.setPen(pg.mkPen(theme.colour("muted")))

    def showEvent(self, event: QShowEvent) -> None:
        """Start to poll for results."""
        super().showEvent(event)
        self._ask()

    def hideEvent(self, event: QHideEvent) -> None:
        """Stop polling while hidden."""
        super().hideEvent(event)
        self._timer.stop()

    def _make_lines(self) -> dict[str, pg.PlotDataItem]:
        self._legend = self._profile.addLegend(labelTextSize="8pt")
        # Below the profile's dome, where no line runs.
        self._legend.anchor((0.5, 1.0), (0.5, 1.0), offset=(0, -12))
        lines = {
            "ball": self._profile.plot(name=tr("ball")),
            "before": self._profile.plot(name=tr("before")),
            "after": self._profile.plot(name=tr("after")),
            "off0": self._residual.plot(),
            "off1": self._residual.plot(),
        }
        self._zero = pg.InfiniteLine(0.0, angle=0)
        self._residual.addItem(self._zero, ignoreBounds=True)
        self._profile.setLabel("left", tr("depth (mm)"))
        self._residual.setLabel("left", tr("depth minus ball (\N{MICRO SIGN}m)"))
        self._residual.setLabel("bottom", tr("x from the ball's centre (mm)"))
        self._residual.setXLink(self._profile)
        for plot in (self._profile, self._residual):
            plot.setMouseEnabled(False, False)
            plot.hideButtons()
            plot.getAxis("left").setWidth(56)
        return lines

    def _both(
        self, effect: Callable[[CurveEdit, str], Effect], edit: CurveEdit, press: str
    ) -> tuple[Effect, Effect]:
        """Return the effects of the initial state and of this one; runs in the thread."""
        if press not in self._before:
            self._before[press] = effect(self._start, press)
        before = self._before[press]
        return before, before if edit == self._start else effect(edit, press)

    def _ask(self) -> None:
        name = self.press.currentData()
        if name is None or not self.isVisible():
            return
        if not self._words.text():
            self._words.setText(tr("Reconstructing the press."))
        self._worker.submit((self._state, name))
        self._timer.start()

    def _poll(self) -> None:
        finished = self._worker.take()
        if finished is None:
            return
        if self._worker.idle:
            self._timer.stop()
        if isinstance(finished.error, InputError):
            self._words.setText(str(finished.error))
        elif finished.error is not None:
            raise finished.error
        elif finished.result is not None and finished.request[1] == self.press.currentData():
            self._show(*finished.result)

    def _show(self, before: Effect, after: Effect) -> None:
        self._lines["ball"].setData(after.position_mm, after.sphere_mm, connect="finite")
        for effect, line, off in ((before, "before", "off0"), (after, "after", "off1")):
            self._lines[line].setData(effect.position_mm, effect.profile_mm)
            residual = UM * effect.residual_mm
            self._lines[off].setData(effect.position_mm, residual, connect="finite")
        self._words.setText(effect_sentence(before, after))


def effect_sentence(before: Effect, after: Effect) -> str:
    """Return the effect on the press as a sentence with numbers."""
    if before is after:
        return tr(
            "Unchanged: error {rms:.1f} \N{MICRO SIGN}m RMS over the contact, {low:+.1f} "
            "\N{MICRO SIGN}m at the deepest point."
        ).format(rms=UM * before.rms_mm, low=UM * before.lowest_mm)
    change = after.rms_mm - before.rms_mm
    if abs(change) < 0.005 * max(before.rms_mm, 1e-9):
        verdict = tr("No significant change")
    else:
        verdict = tr("Better") if change < 0.0 else tr("Worse")
    moved = UM * float(np.abs(after.profile_mm - before.profile_mm).max())
    return tr(
        "{verdict}: RMS error {a:.1f} to {b:.1f} \N{MICRO SIGN}m, at the deepest point {c:+.1f} "
        "to {d:+.1f} \N{MICRO SIGN}m. The depth changed by up to {moved:.1f} \N{MICRO SIGN}m."
    ).format(
        verdict=verdict,
        a=UM * before.rms_mm,
        b=UM * after.rms_mm,
        c=UM * before.lowest_mm,
        d=UM * after.lowest_mm,
        moved=moved,
    )


def _bare_plot() -> pg.PlotWidget:
    plot = without_menus(pg.PlotWidget(viewBox=pg.ViewBox(enableMenu=False)))
    for side in ("left", "bottom"):
        plot.getAxis(side).enableAutoSIPrefix(False)
    return plot
