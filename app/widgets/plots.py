"""What every pyqtgraph plot of this program needs."""

from __future__ import annotations

import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget


def without_menus(plot: pg.PlotWidget) -> pg.PlotWidget:
    """Switch a plot's own context menus off, and let it own what is left of them.

    pyqtgraph makes them without a parent: they would outlive the plot, as windows that nobody
    closes.

    Parameters
    ----------
    plot : PlotWidget
        Made with a view box whose menu is off.
    """
    item = plot.getPlotItem()
    item.setMenuEnabled(False)
    # With its flags: without them it would lie on the plot as a part of it.
    item.ctrlMenu.setParent(plot, item.ctrlMenu.windowFlags())
    return plot


def own_handle_menus(item: pg.ROI, owner: QWidget) -> None:
    """Let a widget own the context menus that pyqtgraph makes for the handles of an item.

    Parameters
    ----------
    item : pyqtgraph.ROI
        With all its handles.
    owner : QWidget
        Is deleted with the item.
    """
    for handle in item.getHandles():
        handle.menu.setParent(owner, handle.menu.windowFlags())
        handle.setAcceptedMouseButtons(Qt.MouseButton.LeftButton)
