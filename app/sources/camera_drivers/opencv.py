"""Cameras through OpenCV and other people's drivers, as one driver."""

from __future__ import annotations

import logging
import math
import re
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from app.sources.source import SourceSetting
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.plugins import CAMERAS, plug_ins
from gelpolight_core.session.camera_controls import CONTROLS

from .driver import (
    COMPRESSED,
    PORT,
    UNCOMPRESSED,
    CameraDevice,
    CameraDisconnected,
    CameraDriver,
    CameraFormat,
    OpenCamera,
)
from .v4l2 import V4l2Device

_LOG = logging.getLogger(__name__)


class AllCameras:
    """The cameras of this computer, and of the drivers that installed packages bring.

    Parameters
    ----------
    ours : CameraDriver
        The driver of this computer's cameras.
    """

    def __init__(self, ours: CameraDriver) -> None:
        self._ours = ours
        self._others: dict[str, CameraDriver] = plug_ins(
            CAMERAS, lambda driver: driver.devices and driver.formats and driver.open
        )
        self._driver_of: dict[str, CameraDriver] = {}

    def devices(self) -> tuple[CameraDevice, ...]:
        """Return the connected cameras. A driver that fails is left out and logged."""
        devices = self._ours.devices()
        for name, driver in self._others.items():
            try:
                listed = tuple(driver.devices())
            except Exception as error:  # other people's code, which may fail in any way
                _LOG.warning("The cameras of the driver %s cannot be listed (%s)", name, error)
                continue
            devices += listed
            self._driver_of |= {device.identity: driver for device in listed}
        return devices

    def formats(self, device: CameraDevice) -> tuple[CameraFormat, ...]:
        """Return the formats that a camera lists."""
        return self._of(device).formats(device)

    def open(self, device: CameraDevice, wanted: CameraFormat | None) -> OpenCamera:
        """Open a camera with its own driver."""
        return self._of(device).open(device, wanted)

    def _of(self, device: CameraDevice) -> CameraDriver:
        return self._driver_of.get(device.identity, self._ours)


ABSENT = -1.0


@dataclass(frozen=True, slots=True)
class _OpenCvProperty:
    """OpenCV's number of a setting, the range to try, and the conversion to and from our unit."""

    number: int
    low: float
    high: float
    step: float = 1.0
    ours: Callable[[float], float] = float
    theirs: Callable[[float], float] = float


def _milliseconds(log2_seconds: float) -> float:
    return 1000.0 * math.exp2(min(max(log2_seconds, -20.0), 10.0))


def _log2_seconds(milliseconds: float) -> float:
    return float(round(math.log2(max(milliseconds, 1e-3) / 1000.0)))


_WINDOWS = {
    "exposure_auto": _OpenCvProperty(cv2.CAP_PROP_AUTO_EXPOSURE, 0.0, 1.0),
    "exposure_ms": _OpenCvProperty(
        cv2.CAP_PROP_EXPOSURE, 2.0**-13 * 1000.0, 1000.0, 0.0, _milliseconds, _log2_seconds
    ),
    "white_balance_auto": _OpenCvProperty(cv2.CAP_PROP_AUTO_WB, 0.0, 1.0),
    "white_balance_k": _OpenCvProperty(cv2.CAP_PROP_WB_TEMPERATURE, 2000.0, 10000.0),
    "gain": _OpenCvProperty(cv2.CAP_PROP_GAIN, 0.0, 255.0),
    "focus_auto": _OpenCvProperty(cv2.CAP_PROP_AUTOFOCUS, 0.0, 1.0),
    "focus": _OpenCvProperty(cv2.CAP_PROP_FOCUS, 0.0, 255.0),
    "gamma": _OpenCvProperty(cv2.CAP_PROP_GAMMA, 0.0, 500.0),
    "brightness": _OpenCvProperty(cv2.CAP_PROP_BRIGHTNESS, -64.0, 255.0),
    "contrast": _OpenCvProperty(cv2.CAP_PROP_CONTRAST, 0.0, 255.0),
    "saturation": _OpenCvProperty(cv2.CAP_PROP_SATURATION, 0.0, 255.0),
    "sharpness": _OpenCvProperty(cv2.CAP_PROP_SHARPNESS, 0.0, 255.0),
}


class OpenCvProperties:
    """The settings of an open capture.

    Parameters
    ----------
    capture : cv2.VideoCapture
        Open capture; its owner closes it.
    interface : int
        OpenCV's number of the interface; on macOS and for files nothing can be set.
    """

    def __init__(self, capture: Any, interface: int) -> None:
        self._capture = capture
        windows = interface in (cv2.CAP_DSHOW, cv2.CAP_MSMF)
        self._properties = _WINDOWS if windows else {}

    def close(self) -> None:
        """Do nothing: no resources are held here."""

    def lacks_bandwidth(self) -> bool:
        """Return False: these systems do not say why a camera sends no images."""
        return False

    def controls(self) -> tuple[SourceSetting, ...]:
        """Return the settings that the camera supports."""
        settings = []
        for key, kind in CONTROLS.items():
            entry = self._properties.get(key)
            read = ABSENT if entry is None else float(self._capture.get(entry.number))
            if entry is None or (read == ABSENT and key != "exposure_ms"):
                continue
            value = entry.ours(read)
            low, high = min(entry.low, value), max(entry.high, value)
            settings.append(SourceSetting(key, kind.label, kind.unit, low, high, entry.step, value))
        return tuple(settings)

    def set(self, key: str, value: float) -> None:
        """Request a value.

        Raises
        ------
        InputError
            If the camera has no such setting or rejects the value.
        """
        entry = self._properties.get(key)
        if entry is None or not self._capture.set(entry.number, entry.theirs(value)):
            label = CONTROLS[key].label if key in CONTROLS else key
            raise InputError(
                f"the camera does not accept {label} {value:g}",
                "Camera",
                Remedy.NO_SUCH_SETTING,
            )


SLOW_READ_S = 2.5
"""After a time-out OpenCV returns the previous image and reports success."""
LINUX = sys.platform.startswith("linux")


def camera_interface() -> int:
    """Return OpenCV's number of this system's camera interface."""
    if LINUX:
        return cv2.CAP_V4L2
    # DirectShow opens much faster than Media Foundation, and can set more.
    return cv2.CAP_DSHOW if sys.platform == "win32" else cv2.CAP_AVFOUNDATION


class OpenCvDriver:
    """The cameras of this computer.

    Parameters
    ----------
    capture : callable, optional
        Opens a capture from an address and an interface, as ``cv2.VideoCapture``.
    interface : int, optional
        OpenCV's number of the interface; by default that of this system.
    """

    def __init__(
        self, capture: Callable[[Any, int], Any] = cv2.VideoCapture, *, interface: int | None = None
    ) -> None:
        self._capture = capture
        self._interface = camera_interface() if interface is None else interface

    def devices(self) -> tuple[CameraDevice, ...]:
        """Return the connected cameras."""
        from cv2_enumerate_cameras import enumerate_cameras  # queries the system when imported

        return tuple(map(_device, enumerate_cameras(self._interface)))

    def formats(self, device: CameraDevice) -> tuple[CameraFormat, ...]:
        """Return the listed formats of a camera that OpenCV can read."""
        if not self._is_v4l2:
            return ()
        device_file = V4l2Device(device.address)
        try:
            readable = UNCOMPRESSED + COMPRESSED
            return tuple(f for f in device_file.formats() if f.code in readable)
        finally:
            device_file.close()

    def open(self, device: CameraDevice, wanted: CameraFormat | None) -> OpenCvCamera:
        """Open a camera, which may take seconds."""
        controls: V4l2Device | None = V4l2Device(device.address) if self._is_v4l2 else None
        address = device.address if not device.address.isdigit() else int(device.address)
        capture = self._capture(address, self._interface)
        if not capture.isOpened():
            if controls is not None:
                controls.close()
            raise CameraDisconnected(
                "the camera cannot be opened", device.name, Remedy.CLOSE_PROGRAM
            )
        if wanted is not None:
            _ask_for(capture, wanted)
        return OpenCvCamera(device, capture, controls or OpenCvProperties(capture, self._interface))

    @property
    def _is_v4l2(self) -> bool:
        return self._interface == cv2.CAP_V4L2


class OpenCvCamera:
    """An open OpenCV capture.

    Parameters
    ----------
    device : CameraDevice
        The camera.
    capture : cv2.VideoCapture
        Owned by this object from now on.
    controls : V4l2Device or OpenCvProperties
        Access to its settings.
    """

    def __init__(
        self, device: CameraDevice, capture: Any, controls: V4l2Device | OpenCvProperties
    ) -> None:
        self._device, self._capture, self._controls = device, capture, controls
        self._has_sent = False

    @property
    def format(self) -> CameraFormat:
        """The format as read back."""
        get = self._capture.get
        code = int(get(cv2.CAP_PROP_FOURCC)) & 0xFFFFFFFF
        letters = bytes((code >> shift) & 0xFF for shift in (0, 8, 16, 24)).decode("latin-1")
        return CameraFormat(
            letters.strip("\0 ") or "?",
            int(get(cv2.CAP_PROP_FRAME_WIDTH)),
            int(get(cv2.CAP_PROP_FRAME_HEIGHT)),
            max(float(get(cv2.CAP_PROP_FPS)), 0.0),
        )

    def read(self) -> tuple[NDArray[np.uint8], float] | None:
        """Wait for the next image, RGB. None: none arrived within OpenCV's own time limit."""
        began_s = time.monotonic()
        good = self._capture.grab()
        came_s = time.monotonic()
        if good and came_s - began_s > SLOW_READ_S:
            return None
        good, bgr = self._capture.retrieve() if good else (False, None)
        if not good or bgr is None or not bgr.size:
            raise self._no_image()
        self._has_sent = True
        return _rgb(bgr), came_s

    def _no_image(self) -> CameraDisconnected:
        """Return why there is no image."""
        if not self._has_sent:
            self._capture.release()  # only one can start it
            if self._controls.lacks_bandwidth():
                return CameraDisconnected(
                    "the USB bus has no room left for its images: other cameras use it",
                    self._device.name,
                    Remedy.OTHER_BUS,
                )
        return CameraDisconnected(
            "the camera delivers no more images", self._device.name, Remedy.CHECK_CABLE
        )

    def controls(self) -> tuple[SourceSetting, ...]:
        """Return the settings."""
        return self._controls.controls()

    def set(self, key: str, value: float) -> None:
        """Request a value."""
        self._controls.set(key, value)

    def close(self) -> None:
        """Release the camera."""
        self._capture.release()
        self._controls.close()


def _ask_for(capture: Any, requested: CameraFormat) -> None:
    """Request a format in the order that drivers need."""
    capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*requested.code.ljust(4)))
    capture.set(cv2.CAP_PROP_FRAME_WIDTH, requested.width)
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, requested.height)
    capture.set(cv2.CAP_PROP_FPS, requested.rate_hz)


def _rgb(image: NDArray[Any]) -> NDArray[np.uint8]:
    """Return OpenCV's blue, green, red (or grey) as red, green, blue in separate memory."""
    bits = image if image.dtype == np.uint8 else (image >> 8).astype(np.uint8)
    if bits.ndim == 2 or bits.shape[2] == 1:
        return np.asarray(cv2.cvtColor(bits, cv2.COLOR_GRAY2RGB), np.uint8)
    return np.asarray(cv2.cvtColor(bits, cv2.COLOR_BGR2RGB), np.uint8)


def _device(listed: Any) -> CameraDevice:
    """Return a camera listed by cv2-enumerate-cameras."""
    has_numbers = listed.vid is not None and listed.pid is not None
    model = f"{listed.vid:04x}:{listed.pid:04x}" if has_numbers else ""
    path = str(listed.path or "")
    port = _linux_port(path) if LINUX else path
    address = path if LINUX else str(listed.index)
    identity = f"{model or listed.name}@{port or listed.index}"
    return CameraDevice(identity, str(listed.name or path), model, address)


def _linux_port(path: str, folder: Path = Path("/sys/class/video4linux")) -> str:
    """Return the serial number of the camera, if it has one, and the port it is plugged into."""
    try:
        interface = (folder / Path(path).name / "device").resolve(strict=True)
        serial = interface.parent / "serial"
        if serial.is_file() and re.search(r"[1-9A-Za-z]", text := serial.read_text().strip()):
            port, _, part = interface.name.rpartition(":")
            return f"{text}/{part}{PORT}{port}"
    except OSError:  # no such folder in a container: use the device's own name
        return path
    return interface.name
