"""The plots of the curve editor: curve over the pixels, effect on a ball press."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import PurePath

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QShowEvent
from PySide6.QtWidgets import QWidget

from app.program.jobs import BackgroundJob, JobQueue
from app.views.map.handles import Handle, HandleItem
from app.widgets import theme
from app.widgets.inputs import ComboBox
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.plots import CHANNEL_COLOURS, apply_theme, bare_plot, without_menus
from app.widgets.text_roles import named_label
from app.widgets.widget_names import set_names
from gelpolight_core.calibration.edit_effect import CurveEditEffect
from gelpolight_core.calibration.reflectance_scatter import ReflectanceScatter

from .lut_model import CurveSet, ReflectanceCurve

BINS = 240
NODE_PX = 11


class CurvePlot(pg.PlotWidget):  # type: ignore[misc]
    """The curve of one channel over the pixels that it was fitted to.

    Parameters
    ----------
    scatter : ReflectanceScatter
        The pixels of the ball presses.
    chosen : callable
        Called with the index of a node that is grabbed or clicked.
    moved : callable
        Called with the index of a dragged node, its cosine and value, and whether the drag ended.
    """

    def __init__(
        self,
        scatter: ReflectanceScatter,
        *,
        chosen: Callable[[int], None],
        moved: Callable[[int, float, float, bool], None],
    ) -> None:
        super().__init__(viewBox=pg.ViewBox(enableMenu=False))
        without_menus(self)
        self._scatter = scatter
        self._pixels, self._line = pg.ImageItem(), pg.PlotCurveItem()
        self._fit = pg.PlotCurveItem()
        self._unseen = [pg.LinearRegionItem(movable=False) for _ in range(2)]
        self._nodes, self._handles = pg.ScatterPlotItem(size=NODE_PX), _NodeHandles(chosen, moved)
        layers = self._pixels, self._fit, self._line, self._nodes, self._handles
        for layer in (*self._unseen, *layers):
            self.addItem(layer, ignoreBounds=True)
        self.setLabel("bottom", "cosine of the angle between normal and light")
        self.setLabel("left", "pixel value / light, I / (\N{GREEK SMALL LETTER RHO}|L|)")
        self.getAxis("left").enableAutoSIPrefix(False)

    def show_channel(
        self, channel: int, fit: ReflectanceCurve, coverage: tuple[float, float]
    ) -> None:
        """Show the pixels and the fit of a channel. Outside of its coverage there are none."""
        apply_theme(self)
        x, y = self._scatter.cosines[channel], self._scatter.values[channel]
        top = 1.12 * float(max(fit.values[-1], np.quantile(y, 0.999)))
        counts, _, _ = np.histogram2d(x, y, BINS, ((0.0, 1.0), (0.0, top)))
        self._pixels.setImage(_density(counts), autoLevels=False)
        self._pixels.setRect(QRectF(0.0, 0.0, 1.0, top))
        shade = QColor(theme.colour("muted"))
        shade.setAlpha(60)
        for region, span in zip(
            self._unseen, ((-1.0, coverage[0]), (coverage[1], 2.0)), strict=True
        ):
            region.setRegion(span)
            region.setBrush(pg.mkBrush(shade))
            for line in region.lines:
                line.setPen(pg.mkPen(shade))
        cosine = np.linspace(0.0, 1.0, 500)
        dots = pg.mkPen(theme.colour("text"), width=1.5, style=Qt.PenStyle.DotLine)
        self._fit.setData(cosine, fit.at(cosine), pen=dots)
        self.setRange(xRange=(-0.02, 1.02), yRange=(-0.02 * top, top), padding=0.0)

    def show_curve(self, curve: ReflectanceCurve, channel: int, selected: int | None) -> None:
        """Show a curve with its nodes, the chosen one filled."""
        colour = QColor(CHANNEL_COLOURS[channel][theme.is_dark()])
        cosine = np.linspace(0.0, 1.0, 500)
        self._line.setData(cosine, curve.at(cosine), pen=pg.mkPen(colour, width=3))
        self._handles.handles = [Handle(str(i), point) for i, point in enumerate(curve.points)]
        base, nodes = theme.colour("base"), range(len(curve.points))
        fills = [pg.mkBrush(colour if index == selected else base) for index in nodes]
        self._nodes.setData(curve.cosines, curve.values, pen=pg.mkPen(colour, width=2), brush=fills)


class _NodeHandles(HandleItem):
    """The nodes, which the user drags."""

    def __init__(
        self, chosen: Callable[[int], None], moved: Callable[[int, float, float, bool], None]
    ) -> None:
        super().__init__()
        self._chosen, self._moved = chosen, moved

    def on_grab(self, handle: Handle) -> None:
        """Choose a node."""
        self._chosen(int(handle.name))

    def on_drag(self, handle: Handle, *, ended: bool) -> None:
        """Move a node."""
        self._moved(int(handle.name), *handle.at, ended)


def _density(counts: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return counts as a fog in the text colour, logarithmic, (columns, rows, 4)."""
    fraction = np.log1p(counts) / max(float(np.log1p(counts.max())), 1e-9)
    colour = theme.colour("text")
    image = np.zeros((*counts.shape, 4), dtype=np.uint8)
    image[..., :3] = (colour.red(), colour.green(), colour.blue())
    image[..., 3] = np.where(counts > 0.0, 30.0 + 150.0 * fraction, 0.0).astype(np.uint8)
    return image


UM = 1000.0


class PressErrorPreview(QWidget):
    """Shows the error of a press with the fitted and with the present curves.

    Parameters
    ----------
    fitted : CurveSet
        The curves to compare with.
    presses : sequence of str
        Names of the presses to choose from.
    effect : callable
        From curves and the name of a press to its effect; called in a thread.
    """

    def __init__(
        self,
        fitted: CurveSet,
        presses: Sequence[str],
        effect: Callable[[CurveSet, str], CurveEditEffect],
    ) -> None:
        super().__init__()
        self._curves = fitted
        fitted_effects: dict[str, CurveEditEffect] = {}

        def both(
            curves: CurveSet, press: str, _progress: object
        ) -> tuple[CurveEditEffect, CurveEditEffect]:
            """Return the effects of the fitted curves and of these. It runs in the thread."""
            if press not in fitted_effects:
                fitted_effects[press] = effect(fitted, press)
            before = fitted_effects[press]
            return before, before if curves == fitted else effect(curves, press)

        self._work = both
        self.jobs = JobQueue("lut-effect", self)
        self._stopped = False
        self.press = set_names(ComboBox(), "lut.press", "Ball press to show")
        self.press.offer((PurePath(name).stem, name) for name in presses)
        self.press.currentIndexChanged.connect(self._ask)
        self.words = named_label("lut.effect", "Effect on the press")
        self.words.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.words.setMinimumHeight(4 * self.fontMetrics().lineSpacing())
        self._plot = set_names(bare_plot(), "lut.residual", "Depth minus ball")
        self._plot.setMouseEnabled(False, False)
        self._plot.setLabel("left", "depth minus ball (\N{MICRO SIGN}m)")
        self._plot.setLabel("bottom", "x (mm)")
        self._lines = self._plot.plot(), self._plot.plot()
        head = hbox(PlainLabel("Effect on"), (self.press, 1))
        vbox(head, self.words, (self._plot, 1), of=self, margins=0, spacing=8)
        self.apply_theme()

    def show_curves(self, curves: CurveSet) -> None:
        """Request the effect of curves, and drop older requests without a result."""
        self._curves = curves
        self._ask()

    def stop(self) -> bool:
        """Stop the thread for good, and return whether it has stopped."""
        self._stopped = True
        return self.jobs.close()

    def apply_theme(self) -> None:
        """Apply the colours of the present theme."""
        apply_theme(self._plot)
        stale = pg.mkPen(theme.colour("stale"), width=2, style=Qt.PenStyle.DashDotLine)
        for line, pen in zip(
            self._lines, (stale, pg.mkPen(theme.colour("accent"), width=2.5)), strict=True
        ):
            line.setPen(pen)

    def showEvent(self, event: QShowEvent) -> None:
        """Request the effect: none is computed while hidden."""
        super().showEvent(event)
        self._ask()

    def _ask(self) -> None:
        name = self.press.currentData()
        if name is not None and self.isVisible() and not self._stopped:
            if not self.words.text():
                self.words.setText("Reconstructing the press.")
            work, show = partial(self._work, self._curves, name), partial(self._show, name)
            self.jobs.cancel()
            self.jobs.submit(BackgroundJob("Effect on the press", work, show, self.words.setText))

    def _show(self, name: str, effects: tuple[CurveEditEffect, CurveEditEffect]) -> None:
        if name == self.press.currentData():
            for effect, line in zip(effects, self._lines, strict=True):
                line.setData(effect.position_mm, UM * effect.residual_mm, connect="finite")
            self.words.setText(effect_sentence(*effects))


def effect_sentence(before: CurveEditEffect, after: CurveEditEffect) -> str:
    """Return the effect on the press as a sentence with numbers."""
    if before is after:
        return (
            f"Unchanged: error {UM * before.rms_mm:.1f} \N{MICRO SIGN}m "
            f"RMS over the contact, {UM * before.lowest_mm:+.1f} "
            "\N{MICRO SIGN}m at the deepest point."
        )
    change = after.rms_mm - before.rms_mm
    if abs(change) < 0.005 * max(before.rms_mm, 1e-9):
        verdict = "No significant change"
    else:
        verdict = "Better" if change < 0.0 else "Worse"
    moved = UM * float(np.abs(after.profile_mm - before.profile_mm).max())
    return (
        f"{verdict}: RMS error {UM * before.rms_mm:.1f} to {UM * after.rms_mm:.1f} "
        f"\N{MICRO SIGN}m, at the deepest point {UM * before.lowest_mm:+.1f} "
        f"to {UM * after.lowest_mm:+.1f} \N{MICRO SIGN}m. The depth "
        f"changed by up to {moved:.1f} \N{MICRO SIGN}m."
    )
