"""The window with a camera's settings, next to the page that shows its image."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QWidget

from app.cameras.manager import CameraManager
from app.cameras.panel import CameraPanel
from app.sources.camera.camera import Camera
from app.widgets.layout import vbox
from app.widgets.naming import named
from gelpolight_core.translation import tr

WIDTH, HEIGHT = 860, 690


class CameraDialog(QDialog):
    """Shows the panel of one camera.

    Parameters
    ----------
    manager : CameraManager
        Manages the cameras and their settings.
    camera : Camera
        The camera to show.
    """

    def __init__(
        self, manager: CameraManager, camera: Camera, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        named(self, "camera", tr("Camera settings"))
        self.setWindowTitle(tr("Camera settings: {name}").format(name=camera.device.name))
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.panel = CameraPanel(manager, camera)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        close = buttons.button(QDialogButtonBox.StandardButton.Close)
        named(close, "camera.close", tr("Close the camera settings"))
        buttons.rejected.connect(self.close)
        vbox((self.panel, 1), buttons, of=self)
        self.resize(WIDTH, HEIGHT)

    def showEvent(self, event: QShowEvent) -> None:
        """Open the camera."""
        super().showEvent(event)
        self.panel.watch(True)

    def hideEvent(self, event: QHideEvent) -> None:
        """Release the camera."""
        self.panel.watch(False)
        super().hideEvent(event)


def show_camera_dialog(manager: CameraManager, camera: Camera, parent: QWidget) -> CameraDialog:
    """Show the window of a camera as a non-modal window; return it."""
    for other in parent.window().findChildren(CameraDialog):
        if other.panel.camera is camera and other.isVisible():
            other.raise_()
            other.activateWindow()
            return other
    dialog = CameraDialog(manager, camera, parent.window())
    dialog.show()
    return dialog
