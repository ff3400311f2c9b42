"""The interface of camera drivers, which hides the differences between systems."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.sources.source import SourceLost, SourceSetting

UNCOMPRESSED = ("RGB3", "BGR3", "YUYV", "UYVY", "NV12", "NV21", "YU12", "YV12")
"""In order of preference: full colour, colour at half width, colour at half width and height."""
COMPRESSED = ("MJPG", "JPEG")
PORT = " at "


class CameraDisconnected(SourceLost):
    """The camera is missing, in use by another program, or has stopped. It may come back."""


@dataclass(frozen=True, slots=True)
class CameraDevice:
    """A connected camera.

    Attributes
    ----------
    identity : str
        Identifies the camera independently of the order of connection: vendor and product, and
        its serial number and port if the system reports them. The port follows :data:`PORT`, where
        there is a serial number.
    name : str
        Name shown to the user.
    model : str
        Vendor and product, ``046d:081b``; empty if they are not known.
    address : str
        Address that the driver opens; changes when the camera is plugged in again.
    """

    identity: str
    name: str
    model: str
    address: str


@dataclass(frozen=True, slots=True)
class CameraFormat:
    """Image format of a camera.

    Attributes
    ----------
    code : str
        Four characters, such as ``YUYV`` or ``MJPG``.
    width, height : int
        In pixels.
    rate_hz : float
        Images per second.
    """

    code: str
    width: int
    height: int
    rate_hz: float

    @property
    def compressed(self) -> bool:
        """Whether the images have compression losses, as with JPEG."""
        return self.code not in UNCOMPRESSED

    def __str__(self) -> str:
        """Return the format as text for the user."""
        return f"{self.code} {self.width} x {self.height} at {self.rate_hz:g} images/s"


class OpenCamera(Protocol):
    """An open camera. One thread reads the images, any thread may change settings."""

    @property
    def format(self) -> CameraFormat:
        """The format as read back, which may differ from the requested one."""

    def read(self) -> tuple[NDArray[np.uint8], float] | None:
        """Wait for the next image (height, width, 3), RGB, with the arrival time (monotonic, s).

        None if none arrives within the driver's own time limit.

        Raises
        ------
        CameraDisconnected
            If there will be no more images.
        """

    def controls(self) -> tuple[SourceSetting, ...]:
        """Return the settings as the camera reports them now."""

    def set(self, key: str, value: float) -> None:
        """Request a value. :meth:`controls` returns the value that was accepted.

        Raises
        ------
        InputError
            If the camera reports an error.
        """

    def close(self) -> None:
        """Release the camera."""


class CameraDriver(Protocol):
    """Finds and opens cameras, from any thread."""

    def devices(self) -> tuple[CameraDevice, ...]:
        """Return the connected cameras."""

    def formats(self, device: CameraDevice) -> tuple[CameraFormat, ...]:
        """Return the formats that a camera lists, if the system reports them."""

    def open(self, device: CameraDevice, wanted: CameraFormat | None) -> OpenCamera:
        """Open a camera, which may take seconds. Format None: the camera's default.

        Raises
        ------
        CameraDisconnected
            If the camera is missing or in use.
        """


def without_port(identity: str) -> str:
    """Return the part of an identity that stays when a camera is plugged into another port."""
    return identity.partition(PORT)[0]


def has_placeholder(identity: str) -> bool:
    """Return whether makers give the serial number of a camera to all of them.

    Its digits are all 0, count up from 1 (``SN0001``, ``0123456789``), or are a New Year's Day and
    the number 1 (``200901010001``); or it has none, as a word has.
    """
    serial = without_port(identity).partition("@")[2].rpartition("/")[0]
    number = re.sub(r"^(19|20)\d\d0101(?=0*1$)", "", re.sub(r"\D", "", serial)).lstrip("0")
    return PORT in identity and "1234567890".startswith(number)


def find_device(
    devices: tuple[CameraDevice, ...], identity: str, is_same: Callable[[str, str], bool]
) -> CameraDevice | None:
    """Return a camera by its identity, also if it was plugged into another port."""
    alike = [device for device in devices if is_same(identity, device.identity)]
    exact = [device for device in alike if device.identity == identity]
    return exact[0] if exact else alike[0] if len(alike) == 1 else None


def best_format(formats: tuple[CameraFormat, ...]) -> CameraFormat | None:
    """Return the best format for calibration among those that a camera lists.

    Uncompressed; then the largest with at least five images per second; then the fastest.
    """
    readable = UNCOMPRESSED + COMPRESSED

    def rank(f: CameraFormat) -> tuple[bool, bool, int, int, int, float]:
        is_fast, pixels, order = f.rate_hz >= 5.0, f.width * f.height, readable.index(f.code)
        return not f.compressed, is_fast, pixels, f.width, -order, f.rate_hz

    return max((f for f in formats if f.code in readable), key=rank, default=None)


def compression_warning(selected: CameraFormat, offered: tuple[CameraFormat, ...]) -> str:
    """Return the drawback of a format in one sentence, or an empty text."""
    if not selected.compressed:
        return ""
    if any(not f.compressed for f in offered):
        return (
            f"{selected.code} images are compressed and can be "
            "wrong by up to 19 grey levels. Choose an "
            "uncompressed format to calibrate, even if it is slower."
        )
    return (
        f"This camera has only compressed images ({selected.code}). "
        "They can be wrong by up to 19 grey "
        "levels. Average many frames, and expect more noise in the depth."
    )
