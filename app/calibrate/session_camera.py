"""The camera in the set-up step; with a session, how it is set is kept and held to."""

from __future__ import annotations

from PySide6.QtCore import QObject

from app.calibrate.controller import CalibrationController
from app.calibrate.setup_form import SetupForm
from app.shell.context import AppContext
from app.sources.camera.applying import is_locked
from app.widgets.source_button import show_settings_of_source
from gelpolight_core.calibration.inputs import FOLDERS, Stage
from gelpolight_core.errors import InputError
from gelpolight_core.session.camera_settings import CameraSettings
from gelpolight_core.translation import tr

LIT = (Stage.RADIANCE, Stage.BACKGROUND, Stage.BALLS)
"""Stages whose brightnesses are compared: the camera must not change between them.

The mirror's spots are compared with nothing, and need a shorter exposure than all else.
"""


class SetupCamera(QObject):
    """Says in the form of the set-up step how the camera is set, and lets it be set.

    Parameters
    ----------
    setup : SetupForm
        The form.
    context : AppContext
        With the cameras and the choice of the source.
    """

    def __init__(self, setup: SetupForm, *, context: AppContext) -> None:
        super().__init__(setup)
        self._setup, self._context = setup, context
        setup.camera_wanted.connect(self._set)
        context.source.changed.connect(self.show)
        context.cameras.changed.connect(self.show)
        self.show()

    def close(self) -> None:
        """Listen no more."""
        self._context.source.changed.disconnect(self.show)
        self._context.cameras.changed.disconnect(self.show)

    def _set(self) -> None:
        show_settings_of_source(self._context, self._setup)

    def show(self) -> None:
        """Say in the set-up step how the camera is set."""
        info = self._context.source.info
        camera = self._context.cameras.of(info)
        if camera is None:
            name = tr("No camera is chosen.") if info is None else info.name
            more = tr("Choose one, or import pictures.") if info is None else ""
            self._setup.show_camera(f"{name} {more}".rstrip(), "", settable=False)
            return
        state, what = camera.state, camera.device.name
        _, clauses = self._context.cameras.differs(camera)
        if clauses:
            text, role = tr("{name} is not set as it was: {how}."), "warn"
            text = text.format(name=what, how="; ".join(clauses))
        elif state.format is None:
            text, role = tr("{name}: set and lock it before the first picture."), "text"
            text = text.format(name=what)
        else:
            held = is_locked(state.controls) and bool(state.controls)
            role = "text" if held else "warn"
            text = f"{what}: {state.format}; " + (tr("locked.") if held else tr("not locked."))
        self._setup.show_camera(text, role, settable=True)


class SessionCamera(QObject):
    """Notes the camera's settings with what is captured, and holds the camera to them.

    Parameters
    ----------
    controller : CalibrationController
        With the session.
    context : AppContext
        With the cameras and the choice of the source.
    """

    def __init__(self, controller: CalibrationController, *, context: AppContext) -> None:
        super().__init__(controller)
        self._controller, self._context = controller, context
        controller.photographed.connect(self._on_photographed)

    def refer(self) -> None:
        """Hold the camera to the settings of the session."""
        stored = self._controller.project.session.camera_settings
        self._context.cameras.refer(tr("the pictures of this session"), stored)

    def _on_photographed(self, stage: str) -> None:
        """Note how the camera is set, as long as nothing rests on how it was set before."""
        camera = self._context.cameras.of(self._context.source.info)
        if camera is None or camera.state.phase != "live":
            return
        session = self._controller.project.session
        lit = sum(len(session.found(FOLDERS[s])) for s in LIT)
        first = lit == 0 or (lit == 1 and stage in {s.value for s in LIT})
        if session.camera_settings is None or first:
            self._note(camera.settings_now())

    def _note(self, settings: CameraSettings) -> None:
        try:
            self._controller.project.set_camera(settings)
        except InputError as error:
            self._controller.refused.emit(str(error))
            return
        self.refer()
