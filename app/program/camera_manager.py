"""The cameras of this computer: shared by all pages, set as for the calibration, and monitored."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from PySide6.QtCore import QObject, Signal

from app.sources.camera_drivers.camera_source import CameraSource
from app.sources.camera_drivers.camera_state import CameraState, differences, is_locked
from app.sources.camera_drivers.driver import (
    PORT,
    CameraDevice,
    CameraDriver,
    CameraFormat,
    best_format,
    compression_warning,
    has_placeholder,
    without_port,
)
from app.sources.camera_drivers.shared_camera import SharedCamera
from app.sources.source import SourceInfo
from gelpolight_core.base.errors import InputError
from gelpolight_core.session.camera_settings import CameraSettings, settings_of_texts

from .settings import AppSettings
from .status import StatusModel
from .toasts import Toasts

_LOG = logging.getLogger(__name__)


class CameraManager(QObject):
    """Manages the cameras and reports their changes to the user.

    Parameters
    ----------
    settings : AppSettings
        Stores how each camera was set.
    status : StatusModel
        Shows the state of the camera in a few words.
    toasts : Toasts
        Shows changes.

    Attributes
    ----------
    driver : CameraDriver
        Finds and opens cameras; tests replace it.

    Signals
    -------
    changed()
        A camera was connected, removed or set, or the reference settings changed.
    """

    changed = Signal()
    _woken = Signal()

    def __init__(self, *, settings: AppSettings, status: StatusModel, toasts: Toasts) -> None:
        super().__init__()
        self._settings, self._status, self._toasts = settings, status, toasts
        self._driver: CameraDriver | None = None
        self._devices: dict[str, CameraDevice] = {}
        self._cameras: dict[str, SharedCamera] = {}
        self._known: dict[str, CameraState] = {}
        self._kept: dict[str, CameraSettings] = {}
        self._shown: dict[str, tuple[str, ...]] = {}
        self._reference: tuple[str, CameraSettings] | None = None
        # Identities without port of cameras that were connected together, and pairs of identities
        # of one camera, as confirmed by the user.
        self._shared = set(settings.camera_notes("shared"))
        self._same = set(settings.camera_notes("same"))
        # Sent from the cameras' threads to this thread; it carries no data.
        self._woken.connect(self._update)

    @property
    def driver(self) -> CameraDriver:
        """What finds and opens cameras."""
        if self._driver is None:
            from app.sources.camera_drivers.opencv import AllCameras, OpenCvDriver  # slow import

            self._driver = AllCameras(OpenCvDriver())
        return self._driver

    @driver.setter
    def driver(self, driver: CameraDriver) -> None:
        self._driver = driver
        self._cameras.clear()

    # Connected cameras

    def infos(self) -> tuple[SourceInfo, ...]:
        """Return the connected cameras as sources."""
        try:
            devices = self.driver.devices()
        except (InputError, OSError) as error:
            _LOG.warning("The cameras cannot be listed: %s", error)
            return ()
        self._devices |= {device.identity: device for device in devices}
        names = [device.name for device in devices]
        identities = [without_port(device.identity) for device in devices]
        for identity in {i for i in identities if identities.count(i) > 1} - self._shared:
            self._shared.add(identity)
            self._settings.keep_camera_note("shared", identity)
        return tuple(
            SourceInfo(
                "camera",
                d.name if names.count(d.name) == 1 else f"{d.name} ({_place(d)})",
                d.identity,
                partial(self._source, d.identity),
            )
            for d in devices
        )

    def key(self, identity: str) -> str:
        """Return what identifies a camera: with its port only if others have the same serial."""
        portless = without_port(identity)
        return identity if portless in self._shared or has_placeholder(identity) else portless

    def is_same(self, stored: str, present: str) -> bool:
        """Return whether two identities belong to one camera."""
        return self.key(stored) == self.key(present) or f"{stored} = {present}" in self._same

    def accept_same(self, stored: str, present: str) -> None:
        """Remember that two identities belong to one camera, as confirmed by the user."""
        self._same.add(f"{stored} = {present}")
        self._settings.keep_camera_note("same", f"{stored} = {present}")
        self._update()

    def is_other(self, stored: str, info: SourceInfo | None) -> bool:
        """Return whether a source is another camera than a stored one, as far as both are known."""
        if not stored or info is None or info.kind != "camera" or not info.detail:
            return False
        return not self.is_same(stored, info.detail)

    def of(self, info: SourceInfo | None) -> SharedCamera | None:
        """Return the camera of a source, or None for other sources."""
        if info is None or info.kind != "camera" or info.detail not in self._devices:
            return None
        return self._camera(info.detail)

    def _camera(self, identity: str) -> SharedCamera:
        if identity not in self._cameras:
            device = self._devices[identity]
            camera = SharedCamera(
                self.driver, device, is_same=self.is_same, on_change=self._woken.emit
            )
            camera.request_settings(self._stored_for(device))
            self._cameras[identity] = camera
        return self._cameras[identity]

    def _source(self, identity: str) -> CameraSource:
        return CameraSource(self._camera(identity))

    def _stored_for(self, device: CameraDevice) -> CameraSettings | None:
        """Return the settings for a camera: as for the calibration, or as it was last used."""
        reference = None if self._reference is None else self._reference[1]
        if reference is not None and self.is_same(reference.identity, device.identity):
            return reference
        return settings_of_texts(self._settings.camera(self.key(device.identity)))

    # Changing settings

    def set_reference(self, what: str, stored: CameraSettings | None) -> None:
        """Make stored settings the reference, and apply them.

        Parameters
        ----------
        what : str
            What the settings belong to, such as "the calibration".
        stored : CameraSettings or None
            The reference settings; None: no reference.
        """
        reference = None if stored is None else (what, stored)
        if reference == self._reference:
            return
        self._reference = reference
        if stored is not None:
            for camera in self._cameras.values():
                if self.is_same(stored.identity, camera.device.identity):
                    camera.request_settings(stored)
        self._update()

    def set(self, camera: SharedCamera, values: Mapping[str, float]) -> None:
        """Change some settings of a camera, now and whenever it is opened."""
        now = camera.requested_settings or camera.settings_now()
        self._want(camera, replace(now, controls={**now.controls, **values}))

    def choose_format(self, camera: SharedCamera, new: CameraFormat) -> None:
        """Use another image format, now and whenever the camera is opened."""
        now, size = camera.requested_settings or camera.settings_now(), (new.width, new.height)
        self._want(camera, replace(now, pixel_format=new.code, size=size, rate_hz=new.rate_hz))

    def sizes(self, info: SourceInfo | None) -> tuple[tuple[int, int], ...]:
        """Return the image sizes that the camera of a source offers."""
        camera = self.of(info)
        offered = () if camera is None else camera.state.offered
        return tuple(dict.fromkeys((f.width, f.height) for f in offered))

    def choose_size(self, info: SourceInfo | None, size: tuple[int, int]) -> None:
        """Use the best format of an image size, if the camera of a source has one."""
        camera = self.of(info)
        offered = () if camera is None else camera.state.offered
        best = best_format(tuple(f for f in offered if (f.width, f.height) == size))
        if camera is not None and best is not None:
            self.choose_format(camera, best)

    def restore_reference(self, camera: SharedCamera) -> None:
        """Set a camera as it was for the calibration or session."""
        if self._reference is not None and self.can_restore(camera):
            self._want(camera, self._reference[1])
            camera.change(self._reference[1].controls)

    def _want(self, camera: SharedCamera, settings: CameraSettings) -> None:
        device = camera.device
        camera.request_settings(
            replace(settings, name=device.name, identity=device.identity, model=device.model)
        )
        self._keep(camera)

    def _keep(self, camera: SharedCamera) -> None:
        """Store how a camera is set, if this is new."""
        settings, identity = camera.requested_settings, camera.device.identity
        if settings is not None and settings != self._kept.get(identity):
            self._kept[identity] = settings
            self._settings.keep_camera(self.key(identity), settings.as_texts())

    def differs(self, camera: SharedCamera) -> tuple[str, tuple[str, ...]]:
        """Return the reference of a camera, and a clause for every difference from it."""
        if self._reference is None:
            return "", ()
        what, stored = self._reference
        state = camera.state
        if state.phase != "live":
            return what, ()
        if not self.can_restore(camera):
            name = f"{stored.name} ({stored.identity})"
            return what, (f"it is another camera than {name}",)
        return what, differences(stored, state.format, state.controls)

    def can_restore(self, camera: SharedCamera) -> bool:
        """Return whether a camera is the one of the calibration or session."""
        stored = None if self._reference is None else self._reference[1]
        return stored is not None and self.is_same(stored.identity, camera.device.identity)

    # Messages

    def _update(self) -> None:
        """Show a toast if something has changed."""
        notes = []
        for identity, camera in self._cameras.items():
            before, now = self._known.get(identity), camera.state
            self._known[identity] = now
            if now.phase != "live" or camera.settling:
                continue
            self._keep(camera)
            if before is not None and before.phase == "away":
                self._toasts.show(f"{camera.device.name} is connected again.", "pass")
            what, clauses = self.differs(camera)
            self._show_once(identity, self._sentences(camera, what, clauses))
            if clauses:
                notes.append(f"not set as for {what}")
            elif now.controls and not is_locked(now.controls):
                notes.append("not locked")
        self._status.update(camera_note=", ".join(dict.fromkeys(notes)))
        self.changed.emit()

    def _sentences(
        self, camera: SharedCamera, what: str, clauses: tuple[str, ...]
    ) -> tuple[str, ...]:
        state, sentences = camera.state, []
        if clauses:
            sentences.append(
                f"The settings of {camera.device.name} differ from those for {what}: "
                f"{'; '.join(clauses)}. Open the camera settings."
            )
        if state.format is not None and state.format.compressed:
            sentences.append(compression_warning(state.format, state.offered))
        return tuple(sentences)

    def _show_once(self, identity: str, sentences: tuple[str, ...]) -> None:
        for sentence in sentences:
            if sentence not in self._shown.get(identity, ()):
                self._toasts.show(sentence, "warn")
        self._shown[identity] = sentences


def _place(device: CameraDevice) -> str:
    """Return where one of several cameras of the same name is connected."""
    return device.identity.partition(PORT)[2] or device.address
