"""Results of a stage as images, side by side, with axes and colour bars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QWidget

from app.view2d import shading
from app.view2d.display import SURROUND, Display, colour_table
from app.view2d.map_view import Extent, MapView, extent_of
from app.view2d.shading import map_image
from app.widgets.label import PlainLabel
from app.widgets.layout import vbox
from app.widgets.meaning import make_bold
from app.widgets.naming import named
from app.widgets.units import per_mm, unit_word
from gelpolight_core.optics.resampling import MembraneGrid
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.translation import tr

Rgb = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Scale:
    """What the colours of an image mean.

    Attributes
    ----------
    colours : str
        Name of the colour map.
    low, high : float
        Values of the first and the last colour.
    unit : str
        Of the values times `factor`.
    factor : float
        See `unit`.
    """

    colours: str
    low: float
    high: float
    unit: str
    factor: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """One image with a title and a caption.

    Attributes
    ----------
    title : str
        Above the image.
    rgb : (rows, columns, 3) uint8
        The image.
    extent : (left, top, right, bottom)
        Its outer edges.
    in_mm : bool
        Whether the extent is in mm on the membrane, or in pixels of the camera.
    caption : str
        Below the image.
    scale : Scale or None
        What the colours mean; None for a photograph.
    outline_mm : (N, 2) or None
        Closed line to draw, in the unit of the extent.
    """

    title: str
    rgb: Rgb
    extent: Extent
    in_mm: bool = True
    caption: str = ""
    scale: Scale | None = None
    outline_mm: NDArray[np.float64] | None = None


def three_maps(
    maps: NDArray[np.float32],
    known: NDArray[np.bool_],
    grid: MembraneGrid,
    caption: str,
    *,
    unit: str = "",
    factor: float = 1.0,
) -> tuple[Panel, ...]:
    """Return one image for each LED.

    Parameters
    ----------
    maps : (rows, columns, 3) float32
        A value for each node and LED.
    known : (rows, columns) bool
        Where the values are valid.
    grid : Grid
        Positions of the nodes.
    caption : str
        The quantity.
    unit, factor : optional
        Unit of the values times the factor.
    """
    panels, channels = [], (tr("Red LED"), tr("Green LED"), tr("Blue LED"))
    colours = Display().colours
    unknown = np.asarray(~known, np.uint8)
    for k in range(3):
        inside = maps[..., k][known]
        if inside.size == 0:
            continue
        low, high = (float(v) for v in np.percentile(inside, [0.5, 99.5]))
        values = np.ascontiguousarray(maps[..., k])
        rgb = shading.coloured(values, colour_table(colours), low, high)
        rgb = shading.outside_filled(rgb, unknown, SURROUND)
        scale = Scale(colours, low, high, unit, factor)
        panels.append(Panel(channels[k], rgb, extent_of(grid), caption=caption, scale=scale))
    return tuple(panels)


def depth_panel(
    title: str, heightmap: HeightMap, outline_mm: NDArray[np.float64] | None = None
) -> Panel:
    """Return a height map in colours, with the outline of a measured object."""
    display = Display()
    shown = map_image(heightmap, display)
    scale = Scale(display.colours, *shown.range_mm, unit_word(), per_mm())
    return Panel(title, shown.rgb, extent_of(heightmap), scale=scale, outline_mm=outline_mm)


class MapsView(QWidget):
    """Images side by side, each as large as possible."""

    def __init__(self) -> None:
        super().__init__()
        named(self, "calibrate.maps", tr("Result as images"))
        self._grid = QGridLayout(self)
        self._shown: list[_PanelView] = []
        self._none = named(PlainLabel(), "calibrate.maps.none", tr("Why there is no image"))
        self._none.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._none.setWordWrap(True)
        self._grid.addWidget(self._none, 0, 0, 1, 2)

    def show_panels(self, panels: Sequence[Panel], *, none: str = "") -> None:
        """Show these images; if there are none, say why."""
        self._none.setText(none)
        self._none.setVisible(not panels and bool(none))
        while len(self._shown) > len(panels):
            view = self._shown.pop()
            self._grid.removeWidget(view)
            view.hide()
            view.deleteLater()
        for number, panel in enumerate(panels):
            if number == len(self._shown):
                self._shown.append(_PanelView(f"calibrate.maps.{number}"))
            self._shown[number].show_panel(panel)
        self._arrange()

    def _arrange(self) -> None:
        """Arrange the images; a single one uses the whole width."""
        columns = 1 if len(self._shown) == 1 else 2
        for view in self._shown:
            self._grid.removeWidget(view)
        for column in range(2):
            self._grid.setColumnStretch(column, int(column < columns))
        for number, view in enumerate(self._shown):
            self._grid.addWidget(view, number // columns, number % columns)


class _PanelView(QWidget):
    """One image with title and caption."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self._title, self._caption = PlainLabel(), PlainLabel()
        self._map = MapView(name, tr("Result"))
        make_bold(self._title)
        for label in (self._title, self._caption):
            label.setAlignment(Qt.AlignmentFlag.AlignCenter)
            label.setWordWrap(True)
        vbox(self._title, (self._map, 1), self._caption, of=self, margins=4)

    def show_panel(self, panel: Panel) -> None:
        self._title.setText(panel.title)
        self._caption.setText(panel.caption)
        self._caption.setVisible(bool(panel.caption))
        self._map.setAccessibleName(f"{panel.title}. {panel.caption}")
        self._map.set_image(panel.rgb, panel.extent, in_mm=panel.in_mm)
        self._map.show_outline(panel.outline_mm)
        self._map.bar.setVisible(panel.scale is not None)
        if panel.scale is not None:
            s = panel.scale
            self._map.show_colours(s.colours, s.low, s.high, s.unit, factor=s.factor)
