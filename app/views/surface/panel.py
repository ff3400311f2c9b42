"""The 3D view with its buttons and menu. Until it is loaded, and without OpenGL: a shaded map."""

from __future__ import annotations

import importlib
import logging
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QPoint, Qt, Signal
from PySide6.QtWidgets import QStackedWidget, QToolButton, QWidget

from app.program.display import DisplayStore
from app.program.jobs import BackgroundJob, JobQueue
from app.program.opengl import opengl_problem
from app.program.settings import AppSettings
from app.widgets.actions import tool_button
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.native_windows import give_own_window
from app.widgets.text_roles import named_label
from app.widgets.widget_names import set_names
from gelpolight_core.base.arrays import PointXY
from gelpolight_core.base.errors import InputError, Remedy

from .display_surface import DisplaySurface, SurfaceLine, pins_text, with_pin
from .scene_export import SceneExport, SceneMenu

if TYPE_CHECKING:
    import pyvista as pv

    from .interactor import Interactor

_LOG = logging.getLogger(__name__)
MODULE = (
    "app.views.surface.interactor"  # imports pyvista, which takes a second, when 3D is first shown
)
HINT_SEEN = "view3d_hint"


class SurfacePanel(QWidget):
    """Shows the surface: as a shaded map until pyvista is loaded, which the first one starts.

    Parameters
    ----------
    jobs : JobQueue
        Load modules in the background.
    settings : AppSettings
        Remember folders, and that the hint was seen.
    display : DisplayStore
        How the surface is drawn.
    report : callable
        Called with the result of saving: a sentence and its kind.
    flat : callable
        Makes the shaded map: a widget with `set_image`, `show_message`, `show_cursor` and the
        signal `pointed`.

    Attributes
    ----------
    view : Interactor or None
        None until it is loaded.
    reason : str
        Why there is no 3D. Empty if there is.
    menu : SceneMenu
        Opened by the button and by a right click.
    tools : QWidget
        The buttons above the view. A page may put them elsewhere.

    Signals
    -------
    pointed(float, float)
        Position (x, y) under the pointer, mm.
    """

    pointed = Signal(float, float)

    def __init__(
        self,
        jobs: JobQueue,
        *,
        settings: AppSettings,
        display: DisplayStore,
        report: Callable[[str, str], object],
        flat: Callable[[], Any],
    ) -> None:
        super().__init__()
        set_names(self, "view3d", "Surface in 3D")
        self._jobs, self._settings, self.display = jobs, settings, display
        self.view: Interactor | None = None
        self.reason = ""
        self.pins: tuple[PointXY, ...] = ()
        self._asked = False
        self._last: DisplaySurface | None = None
        self._lines: tuple[SurfaceLine, ...] = ()
        self._solid: Callable[[], pv.PolyData] | None = None
        self._make_flat = flat
        self._flat: Any = None
        self.saving = SceneExport(self, lambda: self.view, settings=settings, report=report)
        self.menu = SceneMenu(
            self,
            display=display,
            saving=self.saving,
            view_from=self.view_from,
            set_pins=self.set_pins,
        )
        self.menu.pins_action.setEnabled(False)
        self._lay_out()
        display.changed.connect(self._on_display)

    def _lay_out(self) -> None:
        self._stack = QStackedWidget()
        self._words = PlainLabel("No depth yet.", wrap=True)
        self._words.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._words.setMargin(20)
        self._stack.addWidget(self._words)
        self._why = named_label("view3d.reason", "Why 3D is not available")
        self._why.hide()
        self.tools = set_names(QWidget(), "view3d.bar", "View directions")
        tip, show_all = "Show the whole surface (double click)", lambda: self.view_from("fit")
        fit = tool_button("view3d.fit", "Fit", show_all, tip=tip)
        options = set_names(QToolButton(), "view3d.menu", "3D menu", "Options of the 3D view")
        options.setText("Options")
        options.setAutoRaise(True)
        options.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        options.setMenu(self.menu)
        hbox(fit, options, None, of=self.tools, margins=0, spacing=0)
        self._hint = self._make_hint()
        vbox(self.tools, self._why, (self._stack, 1), self._hint, of=self, margins=0, spacing=0)

    def _make_hint(self) -> QWidget:
        bar = QWidget()
        text = PlainLabel(
            "Drag: rotate   Shift+drag: pan   Wheel: zoom   Click: pin   Right click: menu",
            wrap=True,
        )
        accessible = "Hide the hint"
        button = tool_button("view3d.hint_seen", "Got it", self._hide_hint, accessible=accessible)
        button.setAutoRaise(False)
        hbox((text, 1), button, of=bar, margins=(8, 2, 4, 2))
        bar.hide()
        return bar

    def _hide_hint(self) -> None:
        self._hint.hide()
        self._settings.keep_display(HINT_SEEN, "yes")

    # Called by the page

    def view_from(self, name: str) -> None:
        """View from one of the view directions, or show everything (``fit``)."""
        if self.view is not None:
            self.view.view_from(name)

    def show_message(self, text: str) -> None:
        """Show a text instead of the surface."""
        self._last = None
        self._words.setText(text)
        self._stack.setCurrentWidget(self._words)
        self.set_pins(())

    def show_surface(self, surface: DisplaySurface, *, still: bool = False) -> None:
        """Show the surface of a frame, live or `still`."""
        self._last = surface
        if self.view is not None:
            self.view.show_surface(surface, still=still)
            if self.pins:
                self._draw_pins()
            self._stack.setCurrentWidget(self._frame)
        else:
            self._show_flat(surface)
            self._load()

    def _show_flat(self, surface: DisplaySurface) -> None:
        if self._flat is None:
            self._flat = self._make_flat()
            self._flat.show_message("")  # hides the colour bar, which has no range
            self._flat.pointed.connect(self.pointed)
            self._stack.addWidget(self._flat)
        self._flat.set_image(surface.texture, surface.extent_mm)
        self._stack.setCurrentWidget(self._flat)

    def _load(self) -> None:
        """Load the 3D view in the background, once."""
        if self._asked:
            return
        self._asked = True
        if problem := opengl_problem():
            advice = "Install the graphics driver, or Mesa (libgl1-mesa-dri)."
            self._fall_back(f"{problem}. {advice}")
            return
        self._jobs.submit(
            BackgroundJob(
                "Loading the 3D view",
                lambda _progress: _import_view(),
                self._make,
                self._fall_back,
                self._on_stopped,
            )
        )

    def show_cursor(self, x_mm: float, y_mm: float) -> None:
        """Mark a position. NaN: none."""
        if self.view is not None:
            self.view.scene.show_cursor((x_mm, y_mm) if x_mm == x_mm else None)
            self.view.update()
        if self._flat is not None:
            self._flat.show_cursor(x_mm, y_mm)

    def show_lines(self, lines: tuple[SurfaceLine, ...]) -> None:
        """Replace the lines on the surface."""
        if lines == self._lines:
            return
        self._lines = lines
        if self.view is not None:
            self.view.scene.show_lines(lines)
            self.view.update()

    def show_solid(self, make: Callable[[], pv.PolyData] | None) -> None:
        """Show a translucent solid, which is built when 3D is loaded. None: none."""
        self._solid = make
        if self.view is not None:
            self.view.scene.show_solid(None if make is None else make())
            self.view.update()

    def set_pins(self, pins: tuple[PointXY, ...]) -> None:
        """Replace the pins."""
        self.pins = pins
        self.menu.pins_action.setEnabled(bool(pins))
        self._draw_pins()

    def finish(self) -> None:
        """Release the graphics memory."""
        if self.view is not None:
            self.view.finish()
            self.view = None

    # Construction

    def _make(self, kind: type[Interactor]) -> None:
        view = self.view = kind()
        view.set_style(self.display.value)
        view.scene.show_lines(self._lines)
        self.show_solid(self._solid)
        view.pointed.connect(self.pointed)
        view.clicked.connect(lambda x, y: self.set_pins(with_pin(self.pins, (x, y))))
        view.menu_wanted.connect(self._open_menu)
        # Complete it before it is added to the window, which Qt would otherwise rebuild.
        self._frame = QWidget()
        vbox(view, of=self._frame, margins=0)
        give_own_window(self._frame)
        self._stack.addWidget(self._frame)
        if self._flat is not None:
            self._stack.removeWidget(self._flat)
            self._flat.deleteLater()
            self._flat = None
        self._hint.setVisible(not self._settings.display(HINT_SEEN))
        if self._last is not None:
            self.show_surface(self._last)

    def _on_display(self) -> None:
        if self.view is not None:
            self.view.set_style(self.display.value)
            self._draw_pins()

    def _on_stopped(self, _sentence: str) -> None:
        self._asked = False  # the next surface loads it

    def _open_menu(self, at: QPoint) -> None:
        if self.view is not None:
            self.menu.popup(self.view.mapToGlobal(at))

    def _draw_pins(self) -> None:
        if self.view is not None:
            text = "" if self._last is None else pins_text(self._last, self.pins)
            self.view.scene.show_pins(self.pins, text)
            self.view.update()

    def _fall_back(self, reason: str) -> None:
        _LOG.warning("No 3D view: %s", reason)
        self.reason = reason
        self._why.setText(f"Shown as a shaded map, because 3D is not available. {reason}")
        self._why.show()
        self.tools.setEnabled(False)


def _import_view() -> type[Interactor]:
    """Import the 3D view, in a background thread.

    Raises
    ------
    InputError
        If its libraries cannot be loaded.
    """
    try:
        kind: type[Interactor] = importlib.import_module(MODULE).Interactor
    except ImportError as error:
        _LOG.exception("The 3D view cannot be loaded")
        raise InputError(
            "The library pyvista cannot be loaded", "3D view", Remedy.REINSTALL
        ) from error
    return kind
