"""What edited curves do to a ball press: its depth minus the ball, before and after."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import PurePath

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import QWidget

from app.calibrate.reflectance.lut_effect import Effect
from app.calibrate.reflectance.lut_model import CurveSet
from app.services.newest_wins import NewestWins
from app.theme import theme
from app.widgets.inputs import ComboBox
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.naming import named
from app.widgets.plots import apply_theme, bare_plot
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

UM = 1000.0


class Preview(QWidget):
    """Shows the error of a press with the fitted and with the present curves.

    Parameters
    ----------
    fitted : CurveSet
        The curves to compare with.
    presses : sequence of str
        Names of the presses to choose from.
    effect : callable
        From (curves, name of press) to :class:`Effect`; called in a separate thread.
    """

    def __init__(
        self,
        fitted: CurveSet,
        presses: Sequence[str],
        effect: Callable[[CurveSet, str], Effect],
    ) -> None:
        super().__init__()
        self._fitted = self._curves = fitted
        self._before: dict[str, Effect] = {}
        self._worker: NewestWins[tuple[CurveSet, str], tuple[Effect, Effect]] = NewestWins(
            lambda request: self._both(effect, *request), name="lut-effect"
        )
        self._timer = QTimer(self, interval=30)
        self._timer.timeout.connect(self._poll)
        self.press = named(ComboBox(), "lut.press", tr("Ball press to show"))
        for name in presses:
            self.press.addItem(PurePath(name).stem, name)
        self.press.currentIndexChanged.connect(self._ask)
        self.words = named(PlainLabel(wrap=True), "lut.effect", tr("Effect on the press"))
        self.words.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.words.setMinimumHeight(4 * self.fontMetrics().lineSpacing())
        self._plot = named(bare_plot(), "lut.residual", tr("Depth minus ball"))
        self._plot.setMouseEnabled(False, False)
        self._plot.setLabel("left", tr("depth minus ball (\N{MICRO SIGN}m)"))
        self._plot.setLabel("bottom", tr("x (mm)"))
        self._lines = self._plot.plot(), self._plot.plot()
        head = hbox(PlainLabel(tr("Effect on")), (self.press, 1))
        vbox(head, self.words, (self._plot, 1), of=self, margins=0, spacing=8)
        self.apply_theme()

    def show_curves(self, curves: CurveSet) -> None:
        """Request the effect of curves; an older request without a result is dropped."""
        self._curves = curves
        self._ask()

    def stop(self) -> bool:
        """Stop the thread; return whether it has stopped."""
        self._timer.stop()
        return self._worker.stop(timeout_s=5.0)

    def apply_theme(self) -> None:
        """Apply the colours of the present theme."""
        apply_theme(self._plot)
        stale = pg.mkPen(theme.colour("stale"), width=2, style=Qt.PenStyle.DashDotLine)
        for line, pen in zip(
            self._lines, (stale, pg.mkPen(theme.colour("accent"), width=2.5)), strict=True
        ):
            line.setPen(pen)

    def showEvent(self, event: QShowEvent) -> None:
        """Start to poll for results."""
        super().showEvent(event)
        self._ask()

    def hideEvent(self, event: QHideEvent) -> None:
        """Stop polling while hidden."""
        super().hideEvent(event)
        self._timer.stop()

    def _both(
        self, effect: Callable[[CurveSet, str], Effect], curves: CurveSet, press: str
    ) -> tuple[Effect, Effect]:
        """Return the effects of the fitted curves and of these; runs in the thread."""
        if press not in self._before:
            self._before[press] = effect(self._fitted, press)
        before = self._before[press]
        return before, before if curves == self._fitted else effect(curves, press)

    def _ask(self) -> None:
        name = self.press.currentData()
        if name is not None and self.isVisible():
            if not self.words.text():
                self.words.setText(tr("Reconstructing the press."))
            self._worker.submit((self._curves, name))
            self._timer.start()

    def _poll(self) -> None:
        finished = self._worker.take()
        if finished is None:
            return
        if self._worker.idle:
            self._timer.stop()
        if isinstance(finished.error, InputError):
            self.words.setText(str(finished.error))
        elif finished.error is not None:
            raise finished.error
        elif finished.result is not None and finished.request[1] == self.press.currentData():
            for effect, line in zip(finished.result, self._lines, strict=True):
                line.setData(effect.position_mm, UM * effect.residual_mm, connect="finite")
            self.words.setText(effect_sentence(*finished.result))


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
