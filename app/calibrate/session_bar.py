"""The bar above the wizard: leave, undo, and docks."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDockWidget, QMainWindow, QToolBar, QUndoView

from app.calibrate.model import WizardModel
from app.widgets.actions import make_action
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.naming import named
from gelpolight_core.translation import tr


def history_dock(model: WizardModel, window: QMainWindow) -> QDockWidget:
    """Return the dock with the history of captures and corrections."""
    dock = QDockWidget(tr("History"), window)
    text = tr("History of captures and corrections")
    named(dock, "calibrate.history", text)
    view = named(QUndoView(model.undo), "calibrate.history.list", text)
    view.setEmptyLabel(tr("As opened"))
    dock.setWidget(view)
    return dock


class SessionBar(QToolBar):
    """The bar.

    Parameters
    ----------
    window : QMainWindow
        The wizard; its actions work while it is visible.
    model : WizardModel
        Model of the wizard.
    docks : tuple of QDockWidget
        Docks to show and hide.
    """

    def __init__(
        self,
        window: QMainWindow,
        *,
        model: WizardModel,
        docks: tuple[QDockWidget, ...],
    ) -> None:
        super().__init__(tr("Session"), window)
        named(self, "calibrate.bar", tr("Session"))
        self.setMovable(False)
        self.toggleViewAction().setEnabled(False)
        stack = model.undo
        undo = make_action(window, "calibrate.undo", tr("Undo"), stack.undo, keys=("Ctrl+Z",))
        redo = make_action(
            window, "calibrate.redo", tr("Redo"), stack.redo, keys=("Ctrl+Shift+Z", "Ctrl+Y")
        )
        for action, can in ((undo, stack.canUndoChanged), (redo, stack.canRedoChanged)):
            action.setEnabled(False)
            can.connect(action.setEnabled)
        self.leave = make_action(
            window, "calibrate.leave", tr("Sessions"), lambda: None,
            tip=tr("Leave this session; everything is saved"),
        )  # fmt: skip
        self.addActions([self.leave, undo, redo])
        for dock in docks:
            action = dock.toggleViewAction()
            action.setText(dock.windowTitle())
            action.setObjectName(f"{dock.objectName()}.shown")
            self.addAction(action)
        for action in self.actions():
            button = self.widgetForAction(action)
            named(button, f"{action.objectName()}.button", action.text())
            button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        session = model.project.session
        caption = PlainLabel(f"  {session.serial}  ·  {session.folder.name}  ")
        caption.setToolTip(plain_tip(str(session.folder)))
        self.addWidget(caption)
