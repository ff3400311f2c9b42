"""Table of the pages in the navigation. Each is loaded when it is first opened."""

from __future__ import annotations

from dataclasses import dataclass
from pkgutil import resolve_name
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from PySide6.QtWidgets import QWidget

    from app.program.context import AppContext


@dataclass(frozen=True, slots=True)
class PageEntry:
    """One page of the main window.

    A page is a QWidget whose class takes the keyword ``context`` (an AppContext). Optional methods:
    ``enter()`` and ``leave()`` (the page becomes visible or hidden), ``can_close() -> bool`` (asked
    before the window closes), ``unfinished() -> str`` (what would be lost then),
    ``open_path(path)`` (a folder or file was dropped or chosen), ``export_actions()`` (items of
    File > Export), ``begin()`` (start with a new sensor) and ``begin_demo()`` (use the virtual
    sensor). Its ``history`` is the QUndoStack of the Edit menu.

    Attributes
    ----------
    name : str
        Short name for settings and scripts.
    title : str
        Text in the navigation.
    icon : str
        A name of :mod:`app.widgets.icons`.
    factory : str
        ``module:class``. The module is imported when the page is first opened.
    also : tuple of str, optional
        Further modules that the page imports only when it needs them.
    """

    name: str
    title: str
    icon: str
    factory: str
    also: tuple[str, ...] = ()

    @property
    def modules(self) -> tuple[str, ...]:
        """Names of all modules that are loaded before the page is created."""
        return self.factory.partition(":")[0], *self.also

    def make(self, context: AppContext) -> QWidget:
        """Load and create the page."""
        page: QWidget = resolve_name(self.factory)(context=context)
        return page


PAGES = (
    PageEntry("start", "Start", "home", "app.window.start_page:StartPage"),
    PageEntry("sensors", "Sensors", "sensors", "app.sensors.page:SensorsPage"),
    PageEntry(
        "calibrate",
        "Calibrate",
        "calibrate",
        "app.calibrate.page:CalibratePage",
        also=(
            "app.sources.virtual_source",
            "app.sources.source_list",
            "app.source_ui.virtual_session",
            "app.calibrate.reflectance.lut_editor",
        ),
    ),
    PageEntry("inspect", "Inspect", "inspect", "app.inspect.page:InspectPage"),
    PageEntry("measure", "Measure", "measure", "app.measure.page:MeasurePage"),
)
"""The pages of this program in the order of the workflow."""
