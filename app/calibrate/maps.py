"""Results of a stage as images, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QImage, QPixmap, QResizeEvent
from PySide6.QtWidgets import QGridLayout, QSizePolicy, QVBoxLayout, QWidget

from app.widgets.label import PlainLabel
from app.widgets.meaning import make_bold
from app.widgets.naming import named
from gelpolight_core.translation import tr

Rgb = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Panel:
    """One image (rows, columns, 3) uint8 with a title and a caption."""

    title: str
    rgb: Rgb
    caption: str = ""


def three_maps(
    maps: NDArray[np.float32], known: NDArray[np.bool_], caption: str
) -> tuple[Panel, ...]:
    """Return one image for each LED.

    Parameters
    ----------
    maps : (rows, columns, 3) float32
        A value for each node and LED.
    known : (rows, columns) bool
        Where the values are valid.
    caption : str
        Text with the fields ``low`` and ``high``.
    """
    panels, channels = [], (tr("Red LED"), tr("Green LED"), tr("Blue LED"))
    for k in range(3):
        inside = maps[..., k][known]
        if inside.size == 0:
            continue
        low, high = (float(v) for v in np.percentile(inside, [0.5, 99.5]))
        scaled = np.clip((maps[..., k] - low) / max(high - low, 1e-6), 0.0, 1.0)
        image = cv2.applyColorMap((255.0 * scaled).astype(np.uint8), cv2.COLORMAP_VIRIDIS)
        image[~known] = 128
        rgb = np.ascontiguousarray(image[..., ::-1])
        panels.append(Panel(channels[k], rgb, caption.format(low=low, high=high)))
    return tuple(panels)


class MapsView(QWidget):
    """Images side by side, each as large as possible."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
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
        column = QVBoxLayout(self)
        column.setContentsMargins(4, 4, 4, 4)
        self._title, self._caption = PlainLabel(), PlainLabel()
        self._image = named(PlainLabel(), name, tr("Result"))
        self._image.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._image.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Ignored)
        self._image.setMinimumSize(120, 90)
        make_bold(self._title)
        for label in (self._title, self._caption):
            label.setAlignment(Qt.AlignmentFlag.AlignCenter)
            label.setWordWrap(True)
        # The texts stay close to the image, whose height depends on its width.
        column.addStretch(1)
        column.addWidget(self._title)
        column.addWidget(self._image, 1000)
        column.addWidget(self._caption)
        column.addStretch(1)
        self._pixmap = QPixmap()

    def show_panel(self, panel: Panel) -> None:
        rows, columns = panel.rgb.shape[:2]
        image = QImage(panel.rgb.data, columns, rows, 3 * columns, QImage.Format.Format_RGB888)
        self._pixmap = QPixmap.fromImage(image)
        self._title.setText(panel.title)
        self._caption.setText(panel.caption)
        self._image.setAccessibleName(f"{panel.title}. {panel.caption}")
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Show the image at the new size."""
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        if self._pixmap.isNull():
            return
        around = self.layout().contentsMargins()
        wide = self.width() - around.left() - around.right()
        words = sum(max(w.heightForWidth(wide), 0) for w in (self._title, self._caption))
        gaps = around.top() + around.bottom() + 4 * self.layout().spacing()
        room = QSize(wide, self.height() - words - gaps).expandedTo(self._image.minimumSize())
        shown = self._pixmap.scaled(
            room, Qt.AspectRatioMode.KeepAspectRatio, Qt.TransformationMode.SmoothTransformation
        )
        self._image.setMaximumHeight(max(shown.height(), self._image.minimumHeight()))
        self._image.setPixmap(shown)
