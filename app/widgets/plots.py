"""Functions that every pyqtgraph plot of this program needs."""

from __future__ import annotations

import pyqtgraph as pg
from PySide6.QtWidgets import QWidget

from app.widgets import theme

# (light, dark): both contrast with the theme's base colour.
CHANNEL_COLOURS = (("#b3211d", "#ff8a80"), ("#1b6e3a", "#7fdc9a"), ("#1f4fbf", "#8ab4ff"))


def without_menus(plot: pg.PlotWidget) -> pg.PlotWidget:
    """Switch off a plot's own context menus, and make the plot own what remains of them.

    pyqtgraph creates the menus without a parent: they would outlive the plot, as windows that
    nothing
    closes.

    Parameters
    ----------
    plot : PlotWidget
        A plot whose view box has no menu.
    """
    own_plot_menus(plot.getPlotItem(), plot)
    return plot


def bare_plot(**axes: pg.AxisItem) -> pg.PlotWidget:
    """Return a plot without menus and prefixes of units, with special axes by their side."""
    plot = without_menus(pg.PlotWidget(viewBox=pg.ViewBox(enableMenu=False), axisItems=axes))
    plot.hideButtons()
    for side in ("left", "bottom"):
        plot.getAxis(side).enableAutoSIPrefix(False)
    return plot


def apply_theme(plot: pg.PlotWidget) -> None:
    """Apply the colours of the present theme to a plot."""
    plot.setBackground(theme.colour("base"))
    for side in ("bottom", "left"):
        plot.getAxis(side).setPen(pg.mkPen(theme.colour("muted")))
        plot.getAxis(side).setTextPen(pg.mkPen(theme.colour("text")))


def own_plot_menus(item: pg.PlotItem, owner: QWidget) -> None:
    """Switch off the context menus of a plot item, and make a widget own what remains of them."""
    item.setMenuEnabled(False)
    # Keep the window flags: without them the menu would lie on the widget as a part of it.
    item.ctrlMenu.setParent(owner, item.ctrlMenu.windowFlags())
