"""A real camera as an image source."""

from __future__ import annotations

from app.sources.latest import Mailbox
from app.sources.source import SourceFrame, SourceSetting, SourceUnavailable, source_closed_error

from .shared_camera import SharedCamera


class CameraSource:
    """One user's access to a camera that others may use at the same time.

    Parameters
    ----------
    camera : SharedCamera
        The camera; its first user opens it, the last one closes it.
    """

    kind = "camera"

    def __init__(self, camera: SharedCamera) -> None:
        self.camera = camera
        self.name = camera.device.name
        self._newest: Mailbox[SourceFrame] = Mailbox()
        self._open = False

    def open(self) -> None:
        """Let the camera's own thread open it, which may take seconds."""
        if not self._open:
            self._open = True
            self._newest.take()
            self.camera.attach(self._newest.put)

    def frame(self, timeout_s: float) -> SourceFrame | None:
        """Wait for the next frame. None: none arrived in time.

        Raises
        ------
        SourceUnavailable
            If the camera is unplugged or silent; it is tried again automatically.
        SourceLost
            If this source is closed.
        """
        if not self._open:
            raise source_closed_error(self.name)
        frame = self._newest.take(timeout_s)
        if frame is None and (reason := self.camera.trouble()):
            raise SourceUnavailable(reason)
        if frame is None and self.camera.reopening:
            # Otherwise a stream would treat a slow change of the format as a lost camera.
            raise SourceUnavailable("The camera is being reopened. Some cameras take ten seconds.")
        return frame

    def settings(self) -> tuple[SourceSetting, ...]:
        """Return the settings as last reported by the camera."""
        return self.camera.state.controls

    def close(self) -> None:
        """Release the camera. A second call has no effect."""
        if self._open:
            self._open = False
            self.camera.detach(self._newest.put)
