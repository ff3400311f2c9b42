"""Results of a stage as pictures: light intensity, reflectance factors, and a rectified press."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QImage, QPixmap, QResizeEvent
from PySide6.QtWidgets import QGridLayout, QSizePolicy, QVBoxLayout, QWidget

from app.widgets.label import PlainLabel
from app.widgets.meaning import make_bold
from app.widgets.naming import named
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.results import StageResults
from gelpolight_core.reflectance.press import BallPress
from gelpolight_core.translation import tr

Rgb = NDArray[np.uint8]
CHANNELS = (tr("Red LED"), tr("Green LED"), tr("Blue LED"))
CLOSE_UP = 1.6
CLOSE_UP_PX = 420


@dataclass(frozen=True, slots=True)
class Panel:
    """One picture (rows, columns, 3) uint8 with a title and a caption."""

    title: str
    rgb: Rgb
    caption: str = ""


def panels_of(stage: Stage | None, results: StageResults) -> tuple[Panel, ...]:
    """Return the pictures of a stage's result; none where it has no maps."""
    if stage is Stage.RADIANCE and results.radiance is not None:
        return _three_maps(
            results.radiance.radiance,
            results.radiance.usable,
            tr("Light intensity {low:.2f} to {high:.2f} of full scale"),
        )
    if stage is Stage.BACKGROUND and results.factors is not None:
        return _three_maps(
            results.factors.factors,
            results.factors.usable,
            tr("Reflectance factor {low:.2f} to {high:.2f}"),
        )
    return ()


def _three_maps(
    maps: NDArray[np.float32], known: NDArray[np.bool_], caption: str
) -> tuple[Panel, ...]:
    panels = []
    for k in range(3):
        inside = maps[..., k][known]
        if inside.size == 0:
            continue
        low, high = (float(v) for v in np.percentile(inside, [0.5, 99.5]))
        scaled = np.clip((maps[..., k] - low) / max(high - low, 1e-6), 0.0, 1.0)
        image = cv2.applyColorMap((255.0 * scaled).astype(np.uint8), cv2.COLORMAP_VIRIDIS)
        image[~known] = 128
        rgb = np.ascontiguousarray(image[..., ::-1])
        panels.append(Panel(CHANNELS[k], rgb, caption.format(low=low, high=high)))
    return tuple(panels)


def refraction_panels(
    raw: NDArray[Any], press: BallPress, results: StageResults
) -> tuple[Panel, ...]:
    """Return a ball's contact in the raw picture and on the rectified grid (the paper's Fig. 6).

    Parameters
    ----------
    raw : (rows, columns, 3) uint8 or uint16
        The capture.
    press : BallPress
        Found in it.
    results : StageResults
        With the resampling table.
    """
    table = results.table
    assert table is not None
    found = press.indentation
    edge = found.contour.astype(np.float32).reshape(-1, 1, 2)
    seen_u = cv2.remap(table.u_px, edge[..., 0], edge[..., 1], cv2.INTER_LINEAR)
    seen_v = cv2.remap(table.v_px, edge[..., 0], edge[..., 1], cv2.INTER_LINEAR)
    before = np.concatenate([seen_u, seen_v], axis=1)
    eight = (raw >> 8).astype(np.uint8) if raw.dtype == np.uint16 else raw
    flat = table.apply(eight.astype(np.float32) / np.float32(255.0))
    after = (255.0 * np.clip(flat, 0.0, 1.0)).astype(np.uint8)
    text = tr("axes {a:.3f} : 1")
    return (
        Panel(
            tr("As the camera sees it"),
            _close_up(eight, before, ellipse=True),
            text.format(a=_axes(before)),
        ),
        Panel(
            tr("Lens, tilt and refraction corrected"),
            _close_up(after, found.contour, ellipse=False),
            text.format(a=_axes(found.contour)),
        ),
    )


def _axes(points: NDArray[Any]) -> float:
    (_, (one, other), _) = cv2.fitEllipseDirect(points.astype(np.float32).reshape(-1, 1, 2))
    return max(one, other) / max(min(one, other), 1e-9)


def _close_up(rgb: Rgb, points: NDArray[Any], *, ellipse: bool) -> Rgb:
    """Return the surroundings of a contour, enlarged, with the curve fitted to it."""
    centre = points.mean(axis=0)
    reach = CLOSE_UP * float(np.linalg.norm(points - centre, axis=1).max())
    scale = CLOSE_UP_PX / (2.0 * reach)
    shift = CLOSE_UP_PX / 2.0 - scale * centre
    matrix = np.array([[scale, 0.0, shift[0]], [0.0, scale, shift[1]]])
    near = cv2.warpAffine(rgb, matrix, (CLOSE_UP_PX, CLOSE_UP_PX), flags=cv2.INTER_LINEAR)
    near = cv2.convertScaleAbs(near, alpha=220.0 / max(float(np.percentile(near, 99.5)), 1.0))
    at = (scale * points + shift).astype(np.float32)
    for u, v in at:
        cv2.circle(near, (round(float(u)), round(float(v))), 2, (255, 220, 60), -1, cv2.LINE_AA)
    if ellipse:
        box = cv2.fitEllipseDirect(at.reshape(-1, 1, 2))
        cv2.ellipse(near, box, (255, 255, 255), 1, cv2.LINE_AA)
    else:
        u, v, radius = _fit_circle(at)
        cv2.circle(near, (round(u), round(v)), round(radius), (255, 255, 255), 1, cv2.LINE_AA)
    return np.asarray(near, np.uint8)


def _fit_circle(points: NDArray[Any]) -> tuple[float, float, float]:
    """Return centre and radius of the circle through points; a part of it may be missing."""
    middle = points.mean(axis=0)
    away = (points - middle).astype(np.float64)
    sides = np.column_stack([2.0 * away, np.ones(len(away))])
    (u, v, rest), *_ = np.linalg.lstsq(sides, (away**2).sum(axis=1), rcond=None)
    return float(middle[0] + u), float(middle[1] + v), math.sqrt(rest + u * u + v * v)


class MapsView(QWidget):
    """Pictures side by side, each as large as there is room for."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        named(self, "calibrate.maps", tr("Result as pictures"))
        self._grid = QGridLayout(self)
        self._shown: list[_PanelView] = []
        self._none = named(PlainLabel(), "calibrate.maps.none", tr("Why there is no picture"))
        self._none.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._none.setWordWrap(True)
        self._grid.addWidget(self._none, 0, 0, 1, 2)

    def show_panels(self, panels: Sequence[Panel], *, none: str = "") -> None:
        """Show these pictures; where there are none, say why."""
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
        """Lay the pictures out: a single one has the whole width."""
        columns = 1 if len(self._shown) == 1 else 2
        for view in self._shown:
            self._grid.removeWidget(view)
        for column in range(2):
            self._grid.setColumnStretch(column, int(column < columns))
        for number, view in enumerate(self._shown):
            self._grid.addWidget(view, number // columns, number % columns)


class _PanelView(QWidget):
    """One picture with its words."""

    def __init__(self, name: str) -> None:
        super().__init__()
        column = QVBoxLayout(self)
        column.setContentsMargins(4, 4, 4, 4)
        self._title, self._caption = PlainLabel(), PlainLabel()
        self._picture = named(PlainLabel(), name, tr("Result"))
        self._picture.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._picture.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Ignored)
        self._picture.setMinimumSize(120, 90)
        make_bold(self._title)
        for label in (self._title, self._caption):
            label.setAlignment(Qt.AlignmentFlag.AlignCenter)
        # The words stay at the picture, which is as high as its width lets it be.
        column.addStretch(1)
        column.addWidget(self._title)
        column.addWidget(self._picture, 1000)
        column.addWidget(self._caption)
        column.addStretch(1)
        self._pixmap = QPixmap()

    def show_panel(self, panel: Panel) -> None:
        rows, columns = panel.rgb.shape[:2]
        image = QImage(panel.rgb.data, columns, rows, 3 * columns, QImage.Format.Format_RGB888)
        self._pixmap = QPixmap.fromImage(image)
        self._title.setText(panel.title)
        self._caption.setText(panel.caption)
        self._picture.setAccessibleName(f"{panel.title}. {panel.caption}")
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Show the picture at the new size."""
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        if self._pixmap.isNull():
            return
        words = self._title.sizeHint().height() + self._caption.sizeHint().height()
        around = self.layout().contentsMargins()
        gaps = around.top() + around.bottom() + 4 * self.layout().spacing()
        room = QSize(
            self.width() - around.left() - around.right(), self.height() - words - gaps
        ).expandedTo(self._picture.minimumSize())
        shown = self._pixmap.scaled(
            room, Qt.AspectRatioMode.KeepAspectRatio, Qt.TransformationMode.SmoothTransformation
        )
        self._picture.setMaximumHeight(max(shown.height(), self._picture.minimumHeight()))
        self._picture.setPixmap(shown)
