"""A camera shared by several users, which keeps its settings and reconnects."""

from __future__ import annotations

import hashlib
import logging
import operator
import socket
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace

import platformdirs

from app.sources.source import SourceFrame
from app.sources.stoppable_thread import join
from gelpolight_core.base.atomic_write import make_folder
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.file_lock import FileLock
from gelpolight_core.session.camera_settings import CameraSettings

from .camera_state import CameraState, apply_settings, locked_values, stored_format
from .driver import (
    CameraDevice,
    CameraDisconnected,
    CameraDriver,
    CameraFormat,
    OpenCamera,
    best_format,
    find_device,
)

_LOG = logging.getLogger(__name__)

SILENCE_S = 3.0
"""A camera without an image for this long counts as away."""
SLOW_OPEN_S = 15.0
SLOW_REOPEN_S = 2.0
"""Shorter than the silence after which a stream counts its source as lost."""
CHECK_S = 5.0
"""The settings are read again after this time, because another program may change them."""
CLOSE_S = 0.5
"""A camera that is still opening is closed by its thread; stopping a stream can take a second.
"""
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.5, 5.0
"""Before a lost camera is tried again; the pause doubles each time."""
UNSETTLED_FRAMES = 5
"""A driver buffers up to four images from before a setting changed."""

Reader = Callable[[SourceFrame], object]


class SharedCamera:
    """A camera and the single thread that opens, reads, sets and closes it.

    Parameters
    ----------
    driver : CameraDriver
        Opens it.
    device : CameraDevice
        The camera.
    is_same : callable, optional
        Whether two identities are those of one camera, to find it again at another port.
    on_change : callable, optional
        Called without argument, in the camera's thread, when :attr:`state` has changed.
    """

    def __init__(
        self,
        driver: CameraDriver,
        device: CameraDevice,
        *,
        is_same: Callable[[str, str], bool] = operator.eq,
        on_change: Callable[[], object] = lambda: None,
    ) -> None:
        self.device = device
        self._driver, self._is_same, self._on_change = driver, is_same, on_change
        self._lock = threading.Lock()
        self._state = CameraState()
        self._wanted: CameraSettings | None = None
        self._readers: list[Reader] = []
        # None: lock the present settings.
        self._changes: list[Mapping[str, float] | None] = []
        self._thread: threading.Thread | None = None
        self._end = threading.Event()
        self._reopen = threading.Event()
        self._number, self._unsettled, self._pending = 0, 0, 0
        self._since_s = self._checked_s = 0.0
        self._was_live = False

    # Called from any thread

    @property
    def state(self) -> CameraState:
        """The present state."""
        with self._lock:
            return self._state

    @property
    def requested_settings(self) -> CameraSettings | None:
        """The settings applied whenever the camera is opened. None: the camera's defaults."""
        with self._lock:
            return self._wanted

    @property
    def settling(self) -> bool:
        """Whether a request is still waiting."""
        with self._lock:
            return self._pending > 0 or self._reopen.is_set()

    def trouble(self) -> str:
        """Return why no images arrive, as a sentence. Empty: all is well."""
        with self._lock:
            state, silent_s = self._state, time.monotonic() - self._since_s
        if state.phase == "away":
            return state.sentence
        if state.phase == "opening" and state.sentence:
            return state.sentence
        late = state.phase == "opening" and silent_s > SLOW_OPEN_S
        if late or (state.phase == "live" and silent_s > SILENCE_S):
            return str(self._silent(silent_s))
        return ""

    @property
    def reopening(self) -> bool:
        """Whether the camera is being reopened for a short time, without an error."""
        with self._lock:
            silent_s = time.monotonic() - self._since_s
            reopening = self._was_live and self._state.phase == "opening"
            return reopening and not self._state.sentence and silent_s > SLOW_REOPEN_S

    def attach(self, reader: Reader) -> None:
        """Send frames to `reader` in the camera's thread. The first reader opens the camera."""
        with self._lock:
            self._readers.append(reader)
            if len(self._readers) > 1:
                return
            before, self._end = self._thread, threading.Event()
            self._since_s = time.monotonic()
            self._state = replace(self._state, phase="opening", sentence="")
            self._was_live = False
            self._thread = threading.Thread(
                target=self._run,
                args=(self._end, before),
                name=f"camera {self.device.name}",
                daemon=True,
            )
            self._thread.start()

    def detach(self, reader: Reader) -> None:
        """Stop sending frames to `reader`. The last one closes the camera without a long wait."""
        with self._lock:
            if reader not in self._readers:
                return
            self._readers.remove(reader)
            if self._readers:
                return
            thread = self._thread
            self._end.set()
            self._reopen.set()
        if thread is not None:
            join(thread, CLOSE_S)
        self._on_change()

    def request_settings(self, settings: CameraSettings | None) -> None:
        """Apply settings now and whenever the camera is opened. Another format reopens it."""
        with self._lock:
            before, self._wanted = self._wanted, settings
            live = self._state.phase == "live"
        if not live or settings is None or settings == before:
            return
        if stored_format(settings) not in (None, stored_format(before), self.state.format):
            self._reopen.set()
        else:
            self.change(settings.controls)

    def change(self, values: Mapping[str, float]) -> None:
        """Change some settings between two images, if there are any."""
        self._submit(dict(values))

    def lock(self) -> None:
        """Fix all automatic settings at their present values, now and whenever it is opened."""
        self._submit(None)

    def _submit(self, change: Mapping[str, float] | None) -> None:
        with self._lock:
            if self._state.phase == "live":
                self._changes.append(change)
                self._pending += 1

    def settings_now(self) -> CameraSettings:
        """Return the present settings, to be stored."""
        state = self.state
        base = self._settings(state.format or stored_format(self.requested_settings))
        return replace(base, controls={c.key: c.value for c in state.controls})

    def _settings(self, got: CameraFormat | None) -> CameraSettings:
        device = self.device
        base = CameraSettings(device.name, device.identity, device.model)
        if got is None:
            return base
        size = got.width, got.height
        return replace(base, pixel_format=got.code, size=size, rate_hz=got.rate_hz)

    # In the camera's own thread

    def _run(self, end: threading.Event, before: threading.Thread | None) -> None:
        # A driver that still hangs from the last use blocks the camera; a second one could not open
        # it.
        while before is not None and before.is_alive():
            if end.wait(0.05):
                return
        pause_s = FIRST_PAUSE_S
        while not end.is_set():
            number = self._number
            try:
                self._use(end)
            except InputError as error:  # it is away, or in use by another window
                self._went_away(str(error))
            except Exception as error:
                _LOG.exception("The camera %s failed", self.device.name)
                self._went_away(str(self._fault(error)))
            if self._number > number:
                pause_s = FIRST_PAUSE_S
            if not self._reopen.is_set():
                end.wait(pause_s)
                pause_s = min(2.0 * pause_s, LONGEST_PAUSE_S)
        with self._lock:
            if self._end is end:
                self._state = replace(self._state, phase="closed", sentence="")
        self._forget_changes()

    def _use(self, end: threading.Event) -> None:
        """Open the camera and pass its images on until it goes away or must be reopened."""
        with self._lock:
            # If it was away, its error message stays until an image arrives.
            self._state = replace(self._state, phase="opening")
            self._since_s = time.monotonic()
        self._reopen.clear()
        requested = self.requested_settings
        device = find_device(self._driver.devices(), self.device.identity, self._is_same)
        if device is None:
            raise CameraDisconnected(
                "the camera is not plugged in", self.device.name, Remedy.PLUG_IN
            )
        offered = self._driver.formats(device)
        requested_format = stored_format(requested) or best_format(offered)
        if end.is_set():
            return
        with camera_lock(device):
            opened = self._driver.open(device, requested_format)
            try:
                if not end.is_set():
                    self._first_image(opened, end, offered, requested)
                while not end.is_set() and not self._reopen.is_set():
                    self._next_image(opened, end)
                    self._carry_out_changes(opened)
            finally:
                self._forget_changes()
                opened.close()

    def _first_image(
        self,
        opened: OpenCamera,
        end: threading.Event,
        offered: tuple[CameraFormat, ...],
        requested: CameraSettings | None,
    ) -> None:
        """Wait until the camera delivers, then set it: many cameras forget earlier settings."""
        self._next_frame(opened, end)
        applied = apply_settings(opened, {} if requested is None else requested.controls)
        got = opened.format
        state = CameraState("live", "", got, offered, opened.controls(), applied)
        with self._lock:
            self._state, self._since_s = state, time.monotonic()
            self._was_live = True
            self._unsettled = UNSETTLED_FRAMES if applied else 0
            self._checked_s = self._since_s
        self._on_change()

    def _next_frame(self, opened: OpenCamera, end: threading.Event) -> SourceFrame | None:
        """Wait for an image as long as a camera may be silent. None: the thread must end."""
        until_s = time.monotonic() + SILENCE_S
        while not (end.is_set() or self._reopen.is_set()):
            read = opened.read()
            if read is not None:
                rgb, came_s = read
                settled = self._unsettled <= 0
                self._unsettled -= 1
                self._number += 1
                return SourceFrame(rgb, self._number - 1, came_s, settled)
            if time.monotonic() > until_s:
                raise self._silent(SILENCE_S)
        return None

    def _next_image(self, opened: OpenCamera, end: threading.Event) -> None:
        frame = self._next_frame(opened, end)
        if frame is None:
            return
        with self._lock:
            self._since_s = frame.time_s
            readers = tuple(self._readers)
        for reader in readers:
            reader(frame)

    def _carry_out_changes(self, opened: OpenCamera) -> None:
        with self._lock:
            changes, self._changes = self._changes, []
        for values in changes:
            if values is None:
                values = locked_values(opened.controls())
                with self._lock:
                    self._wanted = replace(self._settings(opened.format), controls=values)
            applied = apply_settings(opened, values)
            self._unsettled = UNSETTLED_FRAMES
            done = {a.key: a for a in self.state.applied} | {a.key: a for a in applied}
            with self._lock:
                self._state = replace(
                    self._state, controls=opened.controls(), applied=tuple(done.values())
                )
                self._pending -= 1
        if changes:
            self._on_change()
        elif time.monotonic() - self._checked_s > CHECK_S:
            self._check(opened)

    def _check(self, opened: OpenCamera) -> None:
        """Check whether another program, or the camera itself, has changed a setting."""
        self._checked_s = time.monotonic()
        controls = opened.controls()
        if controls != self.state.controls:
            with self._lock:
                self._state = replace(self._state, controls=controls)
            self._on_change()

    def _went_away(self, sentence: str) -> None:
        with self._lock:
            self._state = replace(self._state, phase="away", sentence=sentence)
        self._forget_changes()
        self._on_change()

    def _forget_changes(self) -> None:
        with self._lock:
            self._changes, self._pending = [], 0

    def _silent(self, silent_s: float) -> CameraDisconnected:
        return CameraDisconnected(
            f"no image has arrived for {silent_s:.0f} seconds",
            self.device.name,
            Remedy.WAIT,
        )

    def _fault(self, error: Exception) -> CameraDisconnected:
        return CameraDisconnected(
            f"an internal error ({type(error).__name__}) stopped the images; see the log",
            self.device.name,
            Remedy.WAIT,
        )


def camera_lock(device: CameraDevice) -> FileLock:
    """Reserve a camera for this window of the program, until it is released.

    Raises
    ------
    InputError
        If another window uses it, which is named.
    """
    folder = platformdirs.user_state_path("gelpolight") / "cameras"
    make_folder(folder)
    # Computers that share the user's folder have cameras of their own.
    place = f"{socket.gethostname()} {device.identity}".encode()

    def refusal(holder: str) -> InputError:
        return CameraDisconnected(
            f"the camera is used by another window of this program ({holder})",
            device.name,
            "Select another camera here, or another source in that window",
        )

    return FileLock(folder / hashlib.sha256(place).hexdigest()[:16], refusal)
