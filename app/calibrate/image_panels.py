"""Results of a stage as images, side by side, with axes and colour bars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QWidget

from app.program.display import DisplaySettings
from app.views.map import shading
from app.views.map.colour_tables import colour_table
from app.views.map.map_view import Extent, MapView, extent_of
from app.views.map.shading import map_image
from app.widgets.label import PlainLabel
from app.widgets.layout import vbox
from app.widgets.text_roles import make_bold
from app.widgets.widget_names import set_names
from gelpolight_core.base.arrays import Rgb8Array
from gelpolight_core.base.compared_quantity import readable_unit
from gelpolight_core.calibration.open_ball_stages import BALLS
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.geometry.resampling import MembraneGrid, ResamplingTable
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.stages.balls.ball_press import BallPress

from .detection_marks import read_raw, table_of


@dataclass(frozen=True, slots=True, eq=False)
class ImagePanel:
    """One image with a title and a caption.

    Attributes
    ----------
    title : str
        Above the image.
    rgb : (rows, columns, 3) uint8
        The image.
    extent : (left, top, right, bottom)
        Outer edges of the image.
    in_mm : bool
        Whether the extent is in mm on the membrane, or in pixels of the camera.
    caption : str
        Below the image.
    scale : (colours, low, high, unit, factor) or None
        Colour scale: name of the colour map, values of its first and its last colour, and
        the unit of the values times a factor; None for a photograph.
    outline_mm : (N, 2) or None
        Closed line to draw, in the unit of the extent.
    """

    title: str
    rgb: Rgb8Array
    extent: Extent
    in_mm: bool = True
    caption: str = ""
    scale: tuple[str, float, float, str, float] | None = None
    outline_mm: NDArray[np.float64] | None = None


def led_panels(
    maps: NDArray[np.float32],
    valid_mask: NDArray[np.bool_],
    grid: MembraneGrid,
    caption: str,
    display: DisplaySettings,
    *,
    unit: str = "",
    factor: float = 1.0,
) -> tuple[ImagePanel, ...]:
    """Return one image for each LED.

    Parameters
    ----------
    maps : (rows, columns, 3) float32
        A value for each node and LED.
    valid_mask : (rows, columns) bool
        Nodes with valid values.
    grid : MembraneGrid
        Positions of the nodes.
    caption : str
        The quantity.
    display : DisplaySettings
        The display settings, for the colours.
    unit, factor : optional
        Unit of the values times the factor.
    """
    panels, channels = [], ("Red LED", "Green LED", "Blue LED")
    colours = display.colours
    outside = np.asarray(~valid_mask, np.uint8)
    for k in range(3):
        inside = maps[..., k][valid_mask]
        if inside.size == 0:
            continue
        low, high = (float(v) for v in np.percentile(inside, [0.5, 99.5]))
        values = np.ascontiguousarray(maps[..., k])
        rgb = shading.apply_colour_map(values, colour_table(colours), low, high)
        rgb = shading.fill_outside(rgb, outside)
        scale = colours, low, high, unit, factor
        panels.append(ImagePanel(channels[k], rgb, extent_of(grid), caption=caption, scale=scale))
    return tuple(panels)


def depth_panel(
    title: str,
    heightmap: HeightMap,
    display: DisplaySettings,
    outline_mm: NDArray[np.float64] | None = None,
) -> ImagePanel:
    """Return a height map in colours, with the outline of a measured object."""
    image = map_image(heightmap, display)
    scale = display.colours, *image.range_mm, *readable_unit(*image.range_mm)
    return ImagePanel(title, image.rgb, extent_of(heightmap), scale=scale, outline_mm=outline_mm)


class MapsView(QWidget):
    """Images side by side, each as large as possible."""

    def __init__(self) -> None:
        super().__init__()
        set_names(self, "calibrate.maps", "Result as images")
        self._grid = QGridLayout(self)
        self._shown: list[_ImagePanelView] = []
        self._none = PlainLabel(wrap=True)
        set_names(self._none, "calibrate.maps.none", "Why there is no image")
        self._none.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._grid.addWidget(self._none, 0, 0, 1, 2)

    def show_panels(self, panels: Sequence[ImagePanel], *, none: str = "") -> None:
        """Show these images, or the reason `none` why there are none."""
        self._none.setText(none)
        self._none.setVisible(not panels and bool(none))
        while len(self._shown) > len(panels):
            view = self._shown.pop()
            self._grid.removeWidget(view)
            view.hide()
            view.deleteLater()
        for number, panel in enumerate(panels):
            if number == len(self._shown):
                self._shown.append(_ImagePanelView(f"calibrate.maps.{number}"))
            self._shown[number].show_panel(panel)
        self._arrange()

    def _arrange(self) -> None:
        """Arrange the images. A single one uses the whole width."""
        columns = 1 if len(self._shown) == 1 else 2
        for view in self._shown:
            self._grid.removeWidget(view)
        for column in range(2):
            self._grid.setColumnStretch(column, int(column < columns))
        for number, view in enumerate(self._shown):
            self._grid.addWidget(view, number // columns, number % columns)


class _ImagePanelView(QWidget):
    """One image with title and caption."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self._title, self._caption = PlainLabel(wrap=True), PlainLabel(wrap=True)
        self._map = MapView(name, "Result")
        make_bold(self._title)
        for label in (self._title, self._caption):
            label.setAlignment(Qt.AlignmentFlag.AlignCenter)
        vbox(self._title, (self._map, 1), self._caption, of=self, margins=4)

    def show_panel(self, panel: ImagePanel) -> None:
        self._title.setText(panel.title)
        self._caption.setText(panel.caption)
        self._caption.setVisible(bool(panel.caption))
        self._map.setAccessibleName(f"{panel.title}. {panel.caption}")
        self._map.set_image(panel.rgb, panel.extent, in_mm=panel.in_mm)
        self._map.show_outline(panel.outline_mm)
        self._map.bar.setVisible(panel.scale is not None)
        if panel.scale is not None:
            colours, low, high, unit, factor = panel.scale
            self._map.show_colours(colours, low, high, unit, factor=factor)


CLOSE_UP = 1.6
ORIGIN = np.zeros(2)


def refraction_panels(
    raw: NDArray[Any], press: BallPress, table: ResamplingTable
) -> tuple[ImagePanel, ...]:
    """Return a ball's contact in the raw image and on the rectified grid (the paper's Fig. 6).

    Parameters
    ----------
    raw : (rows, columns, 3) uint8 or uint16
        The capture.
    press : BallPress
        The press found in it.
    table : ResamplingTable
        Resampling table of the session.
    """
    contour = press.indentation.contour
    column, row = contour.astype(np.float32)[:, None, :].transpose(2, 0, 1)
    contour_px = np.concatenate(
        [cv2.remap(px, column, row, cv2.INTER_LINEAR) for px in (table.u_px, table.v_px)], axis=1
    )
    raw_8bit = (raw >> 8).astype(np.uint8) if raw.dtype == np.uint16 else raw
    rectified = table.apply(raw_8bit.astype(np.float32) / np.float32(255.0))
    rectified_8bit = (255.0 * np.clip(rectified, 0.0, 1.0)).astype(np.uint8)
    grid = table.grid
    corner_mm = np.array([grid.x_mm[0], grid.y_mm[0]])
    title = "Lens, tilt and refraction corrected"
    return (
        _close_up("Raw camera image", raw_8bit, contour_px, in_mm=False),
        _close_up(title, rectified_8bit, contour, origin=corner_mm, pitch=grid.pitch_mm),
    )


def _close_up(
    title: str,
    rgb: NDArray[np.uint8],
    contour: NDArray[Any],
    *,
    origin: NDArray[np.float64] = ORIGIN,
    pitch: float = 1.0,
    in_mm: bool = True,
) -> ImagePanel:
    """Return the part of an image around a contour, with the axis ratio of the contour."""
    centre = contour.mean(axis=0)
    reach_px = CLOSE_UP * float(np.linalg.norm(contour - centre, axis=1).max())
    low = np.maximum(np.round(centre - reach_px).astype(int), 0)
    high = np.minimum(np.round(centre + reach_px).astype(int) + 1, rgb.shape[1::-1])
    part = rgb[low[1] : high[1], low[0] : high[0]]
    bright = cv2.convertScaleAbs(part, alpha=220.0 / max(float(np.percentile(part, 99.5)), 1.0))
    _, axes, _ = cv2.fitEllipseDirect(contour.astype(np.float32).reshape(-1, 1, 2))
    ratio = max(axes) / max(min(axes), 1e-9)
    left, top, right, bottom = np.concatenate(
        [origin + pitch * (corner - 0.5) for corner in (low, high)]
    ).tolist()
    return ImagePanel(
        title,
        np.asarray(bright, np.uint8),
        (left, top, right, bottom),
        in_mm=in_mm,
        caption=f"axis ratio {ratio:.3f} : 1",
        outline_mm=origin + pitch * contour.astype(np.float64),
    )


def most_oblique_press(project: CalibrationProject) -> tuple[ImagePanel, ...]:
    """Return images of the press nearest to the edge, before and after the correction.

    Raises
    ------
    InputError
        If its image cannot be read.
    """
    balls, table = project.results.get(BALLS), table_of(project.results)
    if balls is None or table is None or not balls.presses:
        return ()
    press_by_file = {ball.file: ball.press for ball in balls.seen if ball.press is not None}
    name = max(press_by_file, key=lambda n: sum(c * c for c in press_by_file[n].pose.centre_mm))
    raw = read_raw(project.session.folder / BALLS.folder / name)
    return refraction_panels(raw, press_by_file[name], table)
