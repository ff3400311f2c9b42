"""The camera in the set-up step; a session stores its settings and keeps the camera at them."""

from __future__ import annotations

from functools import partial

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QWidget

from app.calibrate.model import WizardModel
from app.calibrate.setup_form import SetupForm
from app.context.context import AppContext
from app.context.source_button import show_settings_of_source
from app.sources.camera.applying import differences, is_locked
from app.widgets.question import Question
from app.widgets.question import ask as question
from gelpolight_core.errors import InputError
from gelpolight_core.session.camera_settings import CameraSettings
from gelpolight_core.translation import tr


class SetupCamera(QObject):
    """Shows the camera settings in the set-up form, and opens the settings dialog.

    Parameters
    ----------
    setup : SetupForm
        The form.
    context : AppContext
        Context with the cameras and the selected source.
    """

    def __init__(self, setup: SetupForm, *, context: AppContext) -> None:
        super().__init__(setup)
        self._setup, self._context = setup, context
        setup.camera_settings.clicked.connect(self._set)
        context.source.changed.connect(self.show)
        context.cameras.changed.connect(self.show)
        self.show()

    def close(self) -> None:
        """Disconnect from the camera's signals."""
        self._context.source.changed.disconnect(self.show)
        self._context.cameras.changed.disconnect(self.show)

    def _set(self) -> None:
        show_settings_of_source(self._context, self._setup)

    def show(self) -> None:
        """Show the camera settings in the set-up form."""
        info = self._context.source.info
        camera = self._context.cameras.of(info)
        if camera is None:
            name = tr("No camera is selected.") if info is None else info.name
            more = tr("Select one, or import images.") if info is None else ""
            self._setup.show_camera(f"{name} {more}".rstrip(), "", settable=False)
            return
        state, name = camera.state, camera.device.name
        _, clauses = self._context.cameras.differs(camera)
        if clauses:
            text, role = tr("{name} is not set as before: {how}."), "warn"
            text = text.format(name=name, how="; ".join(clauses))
        elif state.format is None:
            text, role = tr("{name}: set and lock the camera before the first image."), "text"
            text = text.format(name=name)
        else:
            locked = is_locked(state.controls) and bool(state.controls)
            role = "text" if locked else "warn"
            text = (
                tr("{name}: {format}, locked.") if locked else tr("{name}: {format}, not locked.")
            )
            text = text.format(name=name, format=state.format)
        self._setup.show_camera(text, role, settable=True)


class SessionCamera(QObject):
    """Stores the camera settings with the session and keeps the camera at them.

    Parameters
    ----------
    model : WizardModel
        Model of the wizard.
    context : AppContext
        Context with the cameras and the selected source.
    window : QWidget
        In front of it the user is asked whether a camera is the same.
    """

    def __init__(self, model: WizardModel, *, context: AppContext, window: QWidget) -> None:
        super().__init__(model)
        self._model, self._context, self._window = model, context, window
        model.photographed.connect(self._on_photographed)
        model.camera_fault = self.fault
        model.camera_change = self.change
        model.from_files = self.from_files

    def fault(self, *, ask: bool = True) -> str:
        """Return why the present camera cannot be used: the session belongs to another camera.

        If both are of one model, the user is asked whether it is the same one at another port.
        """
        session, now = self._model.project.session, self._present()
        stored = session.camera_settings
        if not self._model.project.recipe.files(session):
            return ""
        serial = self._model.live.serial
        if (now is None or stored is None) and serial not in ("", session.serial):
            text = tr(
                "This session belongs to sensor {one}, but the images are those of {other}. Select "
                "the camera of the sensor, or start a new session for the other sensor."
            )
            return text.format(one=session.serial, other=serial)
        cameras = self._context.cameras
        if now is None or stored is None or cameras.is_same(stored.identity, now.identity):
            return ""
        text = tr(
            "This session was captured with the camera {one} ({one_id}), but {other} ({other_id}) "
            "is connected. Connect the first camera, or start a new session for the other sensor."
        ).format(
            one=stored.name,
            one_id=stored.identity,
            other=now.name,
            other_id=now.identity,
        )
        alike = stored.model and stored.model == now.model
        if ask and alike and not self._window.findChild(Question):
            accept = partial(cameras.accept_same, stored.identity, now.identity)
            same = tr("It is the same camera"), accept
            question(self._window, tr("Another camera"), text, same)
        return text

    def from_files(self) -> bool:
        """Return whether there are images, none of them from a camera, and now there is one."""
        session = self._model.project.session
        found = self._model.project.recipe.files(session)
        return bool(found) and session.camera_settings is None and self._present() is not None

    def change(self, stage: str) -> str:
        """Return what was changed on the camera since the image with which a stage is compared."""
        session, stream = self._model.project.session, self._model.live.stream
        stored, others = session.camera_settings, self._lit_folders(other_than=stage)
        if stored is None or stream is None or not any(map(session.found, others)):
            return ""
        camera = self._context.cameras.of(self._context.source.info)
        if camera is not None:
            _, clauses = self._context.cameras.differs(camera)
        else:
            clauses = differences(stored, None, stream.source.settings())
        text = tr("The camera was changed since the other images: {how}. Set it back.")
        return text.format(how="; ".join(clauses)) if clauses else ""

    def _lit_folders(self, *, other_than: str) -> tuple[str, ...]:
        """Return the other folders with which a stage is compared; none if it is not compared."""
        lit = [stage for stage in self._model.project.recipe.stages if stage.lit]
        compared = other_than in [stage.key for stage in lit]
        return tuple(stage.folder for stage in lit if compared and stage.key != other_than)

    def _present(self) -> CameraSettings | None:
        """Return which camera is selected, the virtual one included; None for recorded images."""
        source = self._context.source
        camera = self._context.cameras.of(source.info)
        if camera is not None:
            device = camera.device
            return CameraSettings(device.name, device.identity, device.model)
        if source.info is None or source.info.kind != "virtual" or source.bench is None:
            return None
        serial, stream = source.bench.design.serial, self._model.live.stream
        settings = () if stream is None else stream.source.settings()
        controls = {setting.key: setting.value for setting in settings}
        return CameraSettings(serial, f"virtual:{serial}", controls=controls)

    def refer(self) -> None:
        """Make the settings of the session the reference of the camera."""
        stored = self._model.project.session.camera_settings
        self._context.cameras.refer(tr("the images of this session"), stored)

    def _on_photographed(self, stage: str) -> None:
        """Store the camera settings, as long as no capture depends on the stored ones."""
        session, now = self._model.project.session, self._present()
        camera = self._context.cameras.of(self._context.source.info)
        if now is None or (camera is not None and camera.state.phase != "live"):
            return
        if camera is not None:
            now = camera.settings_now()
        compared = {s.key: s.folder for s in self._model.project.recipe.stages if s.lit}
        lit = sum(len(session.found(folder)) for folder in compared.values())
        first = lit == 0 or (lit == 1 and stage in compared)
        if session.camera_settings is None or first:
            self._note(now)

    def _note(self, settings: CameraSettings) -> None:
        try:
            self._model.project.set_camera(settings)
        except InputError as error:
            self._model.refused.emit(str(error))
            return
        self.refer()
