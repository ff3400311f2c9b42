"""A real camera as a source of pictures."""

from __future__ import annotations

from concurrent.futures import TimeoutError as Late

from app.sources.camera.camera import Camera
from app.sources.mailbox import Mailbox
from app.sources.source import Frame, Setting, SourceAway, SourceLost
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

SET_S = 2.0


class CameraSource:
    """One user's view of a camera that others may use at the same time.

    Parameters
    ----------
    camera : Camera
        Opened by the first of its users, closed by the last.
    """

    kind = "camera"

    def __init__(self, camera: Camera) -> None:
        self.camera = camera
        self.name = camera.device.name
        self._newest: Mailbox[Frame] = Mailbox()
        self._open = False

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels, as read back from the camera."""
        got = self.camera.state.format
        return (0, 0) if got is None else (got.width, got.height)

    def open(self) -> None:
        """Begin; the camera's own thread opens it, which may take seconds."""
        if not self._open:
            self._open = True
            self._newest.take()
            self.camera.attach(self._newest.put)

    def frame(self, timeout_s: float) -> Frame | None:
        """Wait for the next frame; None if there is none in time.

        Raises
        ------
        SourceAway
            If the camera is unplugged or silent; it is tried again by itself.
        SourceLost
            If this is closed.
        """
        if not self._open:
            raise SourceLost(
                tr("it is closed"), where=self.name, advice=tr("Open the camera again")
            )
        frame = self._newest.take(timeout_s)
        if frame is None and (why := self.camera.trouble()):
            raise SourceAway(why)
        if frame is None and self.camera.reopening:
            # Else a stream would count a slow change of the format as the camera's loss.
            raise SourceAway(tr("The camera is being opened anew; some take ten seconds."))
        return frame

    def settings(self) -> tuple[Setting, ...]:
        """Return what can be set, as the camera told it last."""
        return self.camera.state.controls

    def set(self, key: str, value: float) -> float:
        """Change a setting; return what the camera has now."""
        try:
            (applied,) = self.camera.change({key: value}).result(SET_S) or (None,)
        except Late as error:
            raise InputError(
                tr("the camera has not answered within {s:g} seconds").format(s=SET_S),
                where=self.name,
                advice=tr("Check its cable"),
            ) from error
        if applied is None or applied.read is None:
            raise InputError(
                tr("it has no setting {key}").format(key=key),
                where=self.name,
                advice=tr("Use one of {keys}").format(
                    keys=", ".join(setting.key for setting in self.settings())
                ),
            )
        return applied.read

    def close(self) -> None:
        """Let the camera go; harmless when that is done."""
        if self._open:
            self._open = False
            self.camera.detach(self._newest.put)
