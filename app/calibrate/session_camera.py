"""The selected camera: settings, and comparison with the camera of the session."""

from __future__ import annotations

from functools import partial

from PySide6.QtWidgets import QWidget

from app.live.live_session import LiveSession
from app.program.context import AppContext
from app.sources.camera_drivers.camera_state import differences, is_locked
from app.widgets.dialog import QuestionDialog
from app.widgets.dialog import ask as question
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.session.camera_settings import CameraSettings


def camera_state(context: AppContext) -> tuple[str, str, bool]:
    """Return the state of the selected camera, the role of that text, and True if it can be set."""
    info = context.source.info
    camera = context.cameras.of(info)
    if camera is None:
        none = "No camera is selected. Select one, or import images."
        return none if info is None else info.name, "", False
    state, name = camera.state, camera.device.name
    _, clauses = context.cameras.differs(camera)
    if clauses:
        return f"{name} is not set as before: {'; '.join(clauses)}.", "warn", True
    if state.format is None:
        return f"{name}: set and lock the camera before the first image.", "text", True
    locked = is_locked(state.controls) and bool(state.controls)
    word, role = ("locked", "text") if locked else ("not locked", "warn")
    return f"{name}: {state.format}, {word}.", role, True


class SessionCamera:
    """Stores the camera settings with the session and keeps the camera at them.

    Parameters
    ----------
    project : CalibrationProject
        The session.
    live : LiveSession
        The live images.
    context : AppContext
        Context with the cameras and the selected source.
    window : QWidget
        In front of it the user is asked whether a camera is the same.
    """

    def __init__(
        self,
        project: CalibrationProject,
        live: LiveSession,
        *,
        context: AppContext,
        window: QWidget,
    ) -> None:
        self._project, self._live, self._context, self._window = project, live, context, window

    def fault(self, *, ask: bool = True) -> str:
        """Return why the present camera cannot be used: the session belongs to another camera.

        If both are of one model, the user is asked whether it is the same one at another port.
        """
        session, camera = self._project.session, self._present()
        stored = session.camera_settings
        if not self._project.recipe.files(session):
            return ""
        virtual = self._context.source.virtual
        serial = self._live.serial if virtual is None else virtual.design.serial
        if (camera is None or stored is None) and serial not in ("", session.serial):
            return (
                f"This session belongs to sensor {session.serial}, but the images are those of "
                f"{serial}. Select the camera of the sensor, or start a new session for the other "
                "sensor."
            )
        cameras = self._context.cameras
        if camera is None or stored is None or cameras.is_same(stored.identity, camera.identity):
            return ""
        text = (
            f"This session was captured with the camera {stored.name} "
            f"({stored.identity}), but {camera.name} ({camera.identity}) "
            "is connected. Connect the first camera, or start a new session for the other sensor."
        )
        alike = stored.model and stored.model == camera.model
        if ask and alike and not self._window.findChild(QuestionDialog):
            accept = partial(cameras.accept_same, stored.identity, camera.identity)
            answer = "It is the same camera", accept
            question(self._window, "Another camera", text, answer)
        return text

    def from_files(self) -> bool:
        """Return whether there are images, none of them from a camera, and now there is one."""
        session = self._project.session
        has_images = bool(self._project.recipe.files(session))
        return has_images and session.camera_settings is None and self._present() is not None

    def change(self, stage: str) -> str:
        """Return what was changed on the camera since the image with which a stage is compared."""
        session, stream = self._project.session, self._live.stream
        stored, others = session.camera_settings, self._lit_folders(other_than=stage)
        if stored is None or stream is None or not any(map(session.found, others)):
            return ""
        camera = self._context.cameras.of(self._context.source.info)
        if camera is not None:
            _, clauses = self._context.cameras.differs(camera)
        else:
            clauses = differences(stored, None, stream.source.settings())
        if not clauses:
            return ""
        changes = "; ".join(clauses)
        return f"The camera was changed since the other images: {changes}. Set it back."

    def _lit_folders(self, *, other_than: str) -> tuple[str, ...]:
        """Return the other folders with which a stage is compared, if it is."""
        lit = [stage for stage in self._project.recipe.stages if stage.lit]
        compared = other_than in [stage.key for stage in lit]
        return tuple(stage.folder for stage in lit if compared and stage.key != other_than)

    def _present(self) -> CameraSettings | None:
        """Return the selected camera, also the virtual one, or None for recorded images."""
        source = self._context.source
        camera = self._context.cameras.of(source.info)
        if camera is not None:
            device = camera.device
            return CameraSettings(device.name, device.identity, device.model)
        if source.virtual is None:
            return None
        serial, stream = source.virtual.design.serial, self._live.stream
        settings = () if stream is None else stream.source.settings()
        controls = {setting.key: setting.value for setting in settings}
        return CameraSettings(serial, f"virtual:{serial}", controls=controls)

    def refer(self) -> None:
        """Make the settings of the session the reference of the camera."""
        stored = self._project.session.camera_settings
        self._context.cameras.set_reference("the images of this session", stored)

    def note_image(self, stage: str) -> None:
        """Store the camera settings of a new image, as long as no other depends on stored ones.

        Raises
        ------
        InputError
            If they cannot be stored.
        """
        session, settings = self._project.session, self._present()
        camera = self._context.cameras.of(self._context.source.info)
        if settings is None or (camera is not None and camera.state.phase != "live"):
            return
        if camera is not None:
            settings = camera.settings_now()
        compared = {s.key: s.folder for s in self._project.recipe.stages if s.lit}
        lit = sum(len(session.found(folder)) for folder in compared.values())
        first = lit == 0 or (lit == 1 and stage in compared)
        if session.camera_settings is None or first:
            self._project.set_camera(settings)
            self.refer()
