"""The window with a camera's settings, next to the page that shows its image."""

from __future__ import annotations

from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import QWidget

from app.cameras.manager import CameraManager
from app.cameras.panel import CameraPanel
from app.sources.camera.camera import Camera
from app.widgets.dialog import Dialog, Kinds
from app.widgets.naming import named


class CameraDialog(Dialog):
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
        title = f"Camera settings: {camera.device.name}"
        super().__init__(parent, "camera", title, once=True)
        self.panel = CameraPanel(manager, camera)
        close = "Close the camera settings"
        named(self.buttons.button(Kinds.Close), "camera.close", close)
        self.fill((self.panel, 1))
        self.resize(860, 690)

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
