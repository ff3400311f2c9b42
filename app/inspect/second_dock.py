"""Opens and closes the second sensor beside the views of the Inspect page."""

from __future__ import annotations

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import QDockWidget, QWidget

from app.context.context import AppContext
from app.inspect.second_sensor import SecondSensor
from app.inspect.views import AREAS, FIRST_WIDTHS, Views
from app.widgets.actions import make_action
from app.widgets.naming import named
from gelpolight_core.translation import tr


class _Dock(QDockWidget):
    """A dock that says when the user has closed it."""

    closed = Signal()

    def closeEvent(self, event: QCloseEvent) -> None:
        super().closeEvent(event)
        self.closed.emit()


class SecondDock(QObject):
    """Makes the second sensor when it is opened. Nothing of it is left when it is closed.

    Parameters
    ----------
    views : Views
        The views of the first sensor.
    owner : QWidget
        The page.
    context : AppContext
        Of the first sensor.

    Attributes
    ----------
    pane : SecondSensor or None
        The second sensor. None while it is closed.
    """

    def __init__(self, views: Views, owner: QWidget, *, context: AppContext) -> None:
        super().__init__(owner)
        self._views, self._context = views, context
        self._dock: _Dock | None = None
        self._entered = self._visible = False
        self._widths = list(FIRST_WIDTHS)
        self.pane: SecondSensor | None = None
        self.action = make_action(
            owner, "inspect.second", tr("Second sensor"), self._toggle, keys=("Alt+0",),
            icon_name="two-sensors", tip=tr("Show a second sensor beside the first one"),
        )  # fmt: skip
        self.action.setCheckable(True)
        views.offer(self.action)
        views.arranged.connect(self._lay)
        views.wanted_changed.connect(self._want)
        context.requests.preferences_changed.connect(self._show_again)

    def restore(self) -> None:
        """Restore the layout of the views, with the second sensor if it was open."""
        if self._context.settings.second_sensor:
            self._make()
            self.action.setChecked(True)
        self._views.restore()
        if (
            self._dock is not None
            and self._views.dockWidgetArea(self._dock) == AREAS.NoDockWidgetArea
        ):
            self._lay()

    def open(self) -> None:
        """Show the second sensor."""
        if self._dock is None:
            pane = self._make()
            self._widths = [column.width() for column in self._columns]
            self._lay()
            if self._entered:
                pane.enter()
            self._keep(True)
        assert self._dock is not None
        self._dock.show()
        self._dock.raise_()

    def close(self) -> None:
        """Release the second sensor, and remove its view."""
        dock, self._dock = self._dock, None
        if dock is not None:
            self.finish()
            self._views.removeDockWidget(dock)
            self._views.resizeDocks(self._columns, self._widths, Qt.Orientation.Horizontal)
            self._views.docks["look"].raise_()
            dock.deleteLater()
            self._keep(False)

    def enter(self) -> None:
        """Show the source of the second sensor."""
        self._entered = True
        if self.pane is not None:
            self.pane.enter()

    def leave(self) -> None:
        """Release the source of the second sensor."""
        self._entered = False
        if self.pane is not None:
            self.pane.leave()

    def pause(self, on: bool) -> None:
        """Freeze the image of the second sensor, or continue."""
        if self.pane is not None:
            self.pane.pause(on)

    def finish(self) -> None:
        """Release everything. The dock stays, so that its place is saved with the layout."""
        pane, self.pane = self.pane, None
        if pane is not None:
            pane.finish()

    def show_texts(self) -> None:
        """Show the newest figures."""
        if self.pane is not None:
            self.pane.show_texts()

    @property
    def _columns(self) -> list[QDockWidget]:
        return [self._views.docks[name] for name in ("surface", "height", "look")]

    def _lay(self) -> None:
        """Put the dock over the settings: beside the height map, with room in a small window."""
        views, dock = self._views, self._dock
        if dock is None:
            return
        views.addDockWidget(AREAS.LeftDockWidgetArea, dock)
        views.tabifyDockWidget(views.docks["processing"], dock)
        dock.show()
        dock.raise_()
        across, down = Qt.Orientation.Horizontal, Qt.Orientation.Vertical
        views.resizeDocks([*self._columns[:2], dock], [views.width() // 3] * 3, across)
        views.resizeDocks([dock, views.docks["bench"]], [600, 200], down)

    def _make(self) -> SecondSensor:
        self.pane = SecondSensor(context=self._context)
        title = tr("Second sensor")
        self._dock = named(_Dock(title, self._views), "inspect.dock.second", title)
        self._dock.setWidget(self.pane)
        self._dock.closed.connect(self.close)
        self._dock.visibilityChanged.connect(self._on_visible)
        return self.pane

    def _toggle(self) -> None:
        (self.close if self._dock is not None else self.open)()

    def _keep(self, on: bool) -> None:
        self.action.setChecked(on)
        self._context.settings.second_sensor = on

    def _on_visible(self, on: bool) -> None:
        self._visible = on
        self._want()

    def _want(self) -> None:
        if self.pane is not None:
            self.pane.want(self._views.display.display, visible=self._visible)

    def _show_again(self) -> None:
        if self.pane is not None:
            self.pane.show_again()
