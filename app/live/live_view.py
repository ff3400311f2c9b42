"""The live image with its tools, used by every page that shows a camera."""

from __future__ import annotations

import math
import time
from datetime import datetime
from pathlib import Path

import cv2
import numpy as np
from PySide6.QtCore import QSize, QStandardPaths, Qt, Signal
from PySide6.QtGui import QAction, QHideEvent, QKeyEvent, QShowEvent
from PySide6.QtWidgets import QWidget

from app.sources.stream import Stream
from app.views.map.handles import Handle
from app.widgets.actions import icon_button, make_action
from app.widgets.keys import ARROWS, ZOOMS
from app.widgets.layout import hbox, vbox
from app.widgets.text_roles import named_label, set_background_role
from app.widgets.timers import timer
from app.widgets.widget_names import set_names
from gelpolight_core.base.arrays import PixelArray
from gelpolight_core.base.atomic_write import make_folder, write_atomically
from gelpolight_core.base.errors import InputError

from .checks_bar import ChecksBar, Histogram
from .image_checks import (
    BestFocus,
    channel_histograms,
    eight_bits,
    measure_exposure,
    measure_focus,
    pixel_text,
    with_zebra,
)
from .image_view import ImageView
from .overlay import ImageOverlay

# Texts and figures change five times per second; faster changes cannot be read.
CHECK_S = 0.2
# One pixel in nine: still a hundred thousand for a small camera.
CHECK_STRIDE = 3
NUDGE_PX = 0.2
LARGE_NUDGE_PX = 2.0
# Moving by key ends when no key was pressed for this time.
NUDGE_END_MS = 250
ZOOM_STEP = 1.25
CORNER_PX = 10


class LiveView(QWidget):
    """Shows a stream or a still image with checks, and an overlay with movable handles.

    Attributes
    ----------
    image : ImageView
        The image.
    tools : dict of str to QAction
        The actions over the image, by name.
    bar : QWidget
        Their buttons.
    shown_frames : int
        Number of images shown so far.

    Signals
    -------
    moved(str, float, float, float)
        Handle, u, v and radius (0 for a marker), after a drag or a move by key.
    saved(str)
        Path of the saved snapshot.
    refused(str)
        Error message: why a snapshot was not saved.
    """

    moved = Signal(str, float, float, float)
    saved = Signal(str)
    refused = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        set_names(self, "live", "Live view")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        images = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.PicturesLocation)
        self.snapshot_folder = Path(images) / "GelPoLight Studio"
        self._stream: Stream | None = None
        self._rgb: PixelArray | None = None
        self._overlay = ImageOverlay()
        self._best_focus = BestFocus()
        self._judged: tuple[str, ...] = "dark", "focus"
        self._checked_s = -math.inf
        self._pointer = (math.nan, math.nan)
        self.shown_frames = 0
        self.image = ImageView()
        self._make_tools()
        self._checks = ChecksBar()
        self._histogram = Histogram(self.image)
        self._histogram.hide()
        vbox((self.image, 1), of=self, margins=0, spacing=0)
        for floating in (self.bar, self._checks):  # over the image: they take no space from it
            floating.setParent(self.image)
            set_background_role(floating, "image")
        self.image.pointed.connect(self._on_pointed)

        self.image.zoomed.connect(self._show_zoom)
        self.image.resized.connect(self._place)
        self.image.overlay.handle_moved.connect(self._on_handle_moved)
        self._tick = timer(self, 16, self._show_newest_frame, precise=True)
        self._nudge_end = timer(self, NUDGE_END_MS, self._end_nudge, once=True)

    def _make_tools(self) -> None:
        self.tools: dict[str, QAction] = {}
        self.bar = set_names(QWidget(), "live.tools", "Image tools")
        row = hbox(of=self.bar, margins=(4, 2, 8, 2), spacing=2)
        for name, text, key, stays, sign, slot in (
            ("fit", "Fit to view", "F", False, "fit", self.image.fit),
            ("full_size", "Full size, 100 %", "1", False, "full-size", self.image.full_size),
            ("freeze", "Freeze", "Space", True, "pause", lambda: None),
            ("snapshot", "Save snapshot", "P", False, "picture", self.save_snapshot),
            ("zebra", "Mark saturated pixels", "Z", True, "zebra", self._render),
            ("histogram", "Histogram", "H", True, "histogram", self._show_histogram),
            ("overlay", "Show marks", "O", True, "marks", self._draw_overlay),
        ):
            self.tools[name] = make_action(
                self, f"live.{name}", text, slot, keys=(key,), icon_name=sign, inside=True
            )
            self.tools[name].setCheckable(stays)
            button = icon_button(self.tools[name])
            button.setAutoRaise(True)
            button.setIconSize(QSize(20, 20))
            row.addWidget(button)
        self._zoom = named_label("live.zoom", "Magnification", wrap=False)
        self._zoom.setFixedWidth(self._zoom.fontMetrics().horizontalAdvance("0000 %"))
        row.addWidget(self._zoom)
        self._show_zoom(math.nan)
        self.tools["overlay"].setChecked(True)

    # Called by the pages

    def set_stream(self, stream: Stream | None) -> None:
        """Show the newest frames of `stream` from now on. None: remove the image."""
        self._stream = stream
        self._best_focus = BestFocus()
        self._show_focus(stream is not None)
        self._tick.stop()
        if stream is None:
            self._rgb = None
            self.image.show_rgb(None)
            self._checks.show_line("")
            self._checks.show_pixel("")
            self._checks.focus.show_share(0.0)
            self._histogram.show_counts(None)
        elif self.isVisible():
            self._tick.start()

    def show_image(self, rgb: PixelArray) -> None:
        """Show a still image, (rows, columns, 3) uint8 or uint16, and check it at once."""
        self._checked_s = -math.inf
        self._show_focus(False)
        self._show(rgb)

    def set_overlay(self, overlay: ImageOverlay | None) -> None:
        """Draw an overlay on the image, or remove it."""
        self._overlay = overlay or ImageOverlay()
        self._draw_overlay()

    def judge(self, *checks: str) -> None:
        """Judge only this of the images: "dark", and the "focus" of live ones.

        A scene can be dark by design, and most scenes have no edges to focus on.
        """
        self._judged = checks
        self._show_focus(self._stream is not None)

    def _show_focus(self, on: bool) -> None:
        self._checks.focus.setVisible(on and "focus" in self._judged)

    def save_snapshot(self) -> None:
        """Save the shown image as PNG with full bit depth and without marks, named by its time."""
        name = datetime.now().astimezone().strftime("snapshot-%Y%m%d-%H%M%S-%f")[:-3] + ".png"
        path = self.snapshot_folder / name
        try:
            if self._rgb is None:
                raise InputError("there is no image to save", "Live view", "Select a source first")
            _, png = cv2.imencode(".png", np.ascontiguousarray(self._rgb[..., ::-1]))
            make_folder(self.snapshot_folder)
            write_atomically(path, lambda file: file.write(png.tobytes()))
        except InputError as refusal:
            self.refused.emit(str(refusal))
        else:
            self.saved.emit(str(path))

    # Frames

    def _show_newest_frame(self) -> None:
        if self._stream is None or self.tools["freeze"].isChecked():
            return
        frame = self._stream.newest.take()
        now_s = time.monotonic()
        if frame is not None:
            self._show(frame.rgb)
        elif now_s - self._checked_s >= CHECK_S:
            self._checked_s = now_s
            if lost := self._stream.figures().lost:
                self._checks.show_line(lost)

    def _show(self, rgb: PixelArray) -> None:
        resized = self._rgb is None or self._rgb.shape != rgb.shape
        self._rgb = rgb
        self.shown_frames += 1
        self._render()
        if resized:
            self._draw_overlay()
        now_s = time.monotonic()
        if now_s - self._checked_s >= CHECK_S:
            self._checked_s = now_s
            self._check(rgb, now_s)
            self._show_pixel()

    def _render(self) -> None:
        if self._rgb is None:
            return
        striped = self.tools["zebra"].isChecked()
        rgb = with_zebra(self._rgb, self.shown_frames) if striped else eight_bits(self._rgb)
        self.image.show_rgb(rgb)

    def _check(self, rgb: PixelArray, now_s: float) -> None:
        exposure = measure_exposure(rgb, dark="dark" in self._judged)
        self._checks.show_line(f"{exposure.verdict.sign} {exposure.text}")
        self._checks.focus.show_share(self._best_focus.update(measure_focus(rgb), now_s))
        if self._histogram.isVisible():
            self._histogram.show_counts(channel_histograms(rgb[::CHECK_STRIDE, ::CHECK_STRIDE]))

    def _draw_overlay(self) -> None:
        self.image.show_overlay(
            self._overlay if self.tools["overlay"].isChecked() else ImageOverlay()
        )

    # Tools

    def _show_histogram(self) -> None:
        on = self.tools["histogram"].isChecked()
        self._histogram.setVisible(on)
        self._checked_s = -math.inf
        if on and self._rgb is not None:
            self._check(self._rgb, time.monotonic())

    def _show_zoom(self, scale: float) -> None:
        """Show the magnification. 1: full size, NaN: no image."""
        self._zoom.setText("" if math.isnan(scale) else f"{100.0 * scale:.0f} %")
        self._zoom.setHidden(math.isnan(scale))
        self.bar.adjustSize()

    def _on_pointed(self, u: float, v: float) -> None:
        self._pointer = (u, v)
        self._show_pixel()

    def _show_pixel(self) -> None:
        self._checks.show_pixel("" if self._rgb is None else pixel_text(self._rgb, *self._pointer))

    # Handles

    def _on_handle_moved(self, handle: Handle) -> None:
        self._nudge_end.stop()
        self.moved.emit(handle.name, *handle.at, handle.radius)

    def _selected(self) -> Handle | None:
        item = self.image.overlay
        return next((h for h in item.handles if h.name == item.selected), None)

    def _end_nudge(self) -> None:
        handle = self._selected()
        if handle is not None:
            self._on_handle_moved(handle)

    def _nudge(self, event: QKeyEvent) -> bool:
        """Move or resize the selected handle by a key. Return whether the key does that."""
        handle = self._selected()
        if handle is None:
            return False
        held = event.modifiers()
        step = LARGE_NUDGE_PX if held & Qt.KeyboardModifier.ShiftModifier else NUDGE_PX
        # A plus needs Shift on many keyboards, so Ctrl makes the large step here.
        radius_step = LARGE_NUDGE_PX if held & Qt.KeyboardModifier.ControlModifier else NUDGE_PX
        match Qt.Key(event.key()):
            case key if key in ARROWS:
                du, dv = ARROWS[key]
                handle = handle.moved(step * du, step * dv)
            case key if key in ZOOMS:
                handle = handle.resized(ZOOMS[key] * radius_step)
            case _:
                return False
        self.image.overlay.place(handle)
        self._nudge_end.start()
        return True

    # Qt

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: D102
        item = self.image.overlay
        if self._nudge(event):
            return
        match Qt.Key(event.key()):
            case Qt.Key.Key_PageDown | Qt.Key.Key_PageUp as key if item.handles:
                item.select_next(1 if key == Qt.Key.Key_PageDown else -1)
            case Qt.Key.Key_Escape if item.selected:
                item.select("")
            case key if key in ZOOMS:
                self.image.zoom_by(ZOOM_STEP ** ZOOMS[key])
            case _:
                super().keyPressEvent(event)

    def showEvent(self, event: QShowEvent) -> None:  # noqa: D102
        super().showEvent(event)
        if self._stream is not None:
            self._tick.start()

    def hideEvent(self, event: QHideEvent) -> None:  # noqa: D102
        super().hideEvent(event)
        self._tick.stop()
        if self._nudge_end.isActive():
            self._nudge_end.stop()
            self._end_nudge()

    def _place(self) -> None:
        """Put the tools into the upper left corner, and the checks along the lower edge."""
        view_rect, checks = self.image.rect(), self._checks.sizeHint().height()
        self.bar.adjustSize()
        self._checks.setGeometry(0, view_rect.height() - checks, view_rect.width(), checks)
        self._histogram.move(
            view_rect.width() - self._histogram.width() - CORNER_PX,
            view_rect.height() - checks - self._histogram.height() - CORNER_PX,
        )
