"""Functions that every pyqtgraph plot of this program needs."""

from __future__ import annotations

import pyqtgraph as pg
from PySide6.QtWidgets import QWidget


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


def own_plot_menus(item: pg.PlotItem, owner: QWidget) -> None:
    """Switch off the context menus of a plot item, and make a widget own what remains of them."""
    item.setMenuEnabled(False)
    # Keep the window flags: without them the menu would lie on the widget as a part of it.
    item.ctrlMenu.setParent(owner, item.ctrlMenu.windowFlags())
