"""The 3D view with its presets; where 3D is not to be had, the relief in 2D and the reason."""

from __future__ import annotations

import importlib
import logging

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QStackedWidget, QToolButton, QVBoxLayout, QWidget

from app.inspect.draped import DrapedLine
from app.inspect.map_view import MapView
from app.inspect.surface import Surface
from app.shell.jobs import Job, Jobs
from app.widgets.label import PlainLabel
from app.widgets.naming import named
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

_LOG = logging.getLogger(__name__)
MODULE = "app.inspect.surface_view"  # brings VTK: half a second, when 3D is first looked at


def preset_names() -> dict[str, tuple[str, str]]:
    """Return what each preset is called, and its key."""
    return {
        "oblique": (tr("Oblique"), "Ctrl+Shift+O"),
        "top": (tr("Top"), "Ctrl+Shift+T"),
        "front": (tr("Front"), "Ctrl+Shift+F"),
        "side": (tr("Side"), "Ctrl+Shift+S"),
    }


class SurfacePanel(QWidget):
    """Shows the surface; VTK is loaded when the first one comes.

    Parameters
    ----------
    jobs : Jobs
        Loads beside the window.

    Attributes
    ----------
    view : SurfaceView or None
        Once it is there.
    reason : str
        Why there is no 3D; empty where there is.

    Signals
    -------
    pointed(float, float)
        Place (x, y) under the pointer, mm.
    """

    pointed = Signal(float, float)

    def __init__(self, jobs: Jobs) -> None:
        super().__init__()
        named(self, "inspect.surface", tr("Surface in 3D"))
        self._jobs = jobs
        self.view = None
        self.reason = ""
        self._asked = False
        self._last: Surface | None = None
        self._exaggeration = 1.0
        self._lines: tuple[DrapedLine, ...] = ()
        self._stack = QStackedWidget()
        self._words = PlainLabel(tr("No depth yet."))
        self._words.setWordWrap(True)
        self._words.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._words.setMargin(20)
        self._stack.addWidget(self._words)
        self._flat: MapView | None = None
        self._why = named(PlainLabel(), "inspect.surface.reason", tr("Why there is no 3D"))
        self._why.setWordWrap(True)
        self._why.hide()
        row = QHBoxLayout()
        row.setContentsMargins(4, 2, 4, 2)
        row.setSpacing(2)
        for name, (text, keys) in preset_names().items():
            row.addWidget(self._button(name, text, f"{text} ({keys})"))
        row.addStretch(1)
        reset = self._button("fit", tr("Fit"), tr("Show all of it (double click)"))
        row.addWidget(reset)
        self._tools = QWidget()
        self._tools.setLayout(row)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self._tools)
        column.addWidget(self._why)
        column.addWidget(self._stack, 1)

    def _button(self, name: str, text: str, tip: str) -> QToolButton:
        button = named(QToolButton(), f"inspect.surface.{name}", text, tip)
        button.setText(text)
        button.setAutoRaise(True)
        button.clicked.connect(lambda: self.look_from(name))
        return button

    def look_from(self, name: str) -> None:
        """Look from a preset, or show all (``fit``)."""
        if self.view is not None:
            self.view.fit() if name == "fit" else self.view.look_from(name)

    def show_surface(self, surface: Surface | None) -> None:
        """Show the surface of a frame; None: there is none."""
        self._last = surface
        if surface is None:
            self._stack.setCurrentWidget(self._words)
        elif self.view is not None:
            self.view.show_surface(surface)
            self._stack.setCurrentWidget(self.view)
        elif self._flat is not None:
            self._flat.show_picture(surface.texture, surface.extent_mm)
            self._stack.setCurrentWidget(self._flat)
        else:
            self.load()

    def load(self) -> None:
        """Load VTK beside the window, once."""
        if not self._asked:
            self._asked = True
            self._words.setText(tr("Loading the 3D view…"))
            self._jobs.submit(
                Job(
                    tr("Loading the 3D view"),
                    lambda _tell: importlib.import_module(MODULE),
                    lambda module: self._make(module.SurfaceView),
                )
            )

    def set_exaggeration(self, factor: float) -> None:
        """Stretch the depth."""
        self._exaggeration = factor
        if self.view is not None:
            self.view.set_exaggeration(factor)

    def show_cursor(self, x_mm: float, y_mm: float) -> None:
        """Mark a place."""
        for view in (self.view, self._flat):
            if view is not None:
                view.show_cursor(x_mm, y_mm)

    def show_lines(self, lines: tuple[DrapedLine, ...]) -> None:
        """Lay lines on the surface in the place of those that are there."""
        self._lines = lines
        if self.view is not None:
            self.view.show_lines(lines)

    def finish(self) -> None:
        """Give the graphics memory back."""
        if self.view is not None:
            self.view.finish()

    def _make(self, kind: type) -> None:
        try:
            self.view = kind()
        except InputError as error:
            self._fall_back(str(error))
        else:
            self.view.set_exaggeration(self._exaggeration)
            self.view.show_lines(self._lines)
            self.view.pointed.connect(self.pointed)
            self._stack.addWidget(self.view)
        self._words.setText(tr("No depth yet."))
        self.show_surface(self._last)

    def _fall_back(self, reason: str) -> None:
        _LOG.warning("No 3D view: %s", reason)
        self.reason = reason
        self._why.setText(tr("Shown as a shaded map: {reason}").format(reason=reason))
        self._why.show()
        self._tools.hide()
        self._flat = MapView("inspect.surface.flat", tr("Shaded map"))
        self._flat.pointed.connect(self.pointed)
        self._stack.addWidget(self._flat)
