"""What a driver of cameras offers; behind it everything is the system's, before it ours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.sources.source import Setting, SourceLost
from gelpolight_core.translation import tr

UNCOMPRESSED = ("RGB3", "BGR3", "YUYV", "UYVY", "NV12", "NV21", "YU12", "YV12")
"""In the order of preference: full colour, colour at half width, at half width and height."""
COMPRESSED = ("MJPG", "JPEG")


class CameraGone(SourceLost):
    """The camera is not there, is in use elsewhere, or has stopped; it may come back."""


@dataclass(frozen=True, slots=True)
class Device:
    """A camera that is plugged in.

    Attributes
    ----------
    identity : str
        Tells it from others, whatever the order in which they were plugged in: vendor and product,
        and its serial number or place where the system tells them.
    name : str
        What people read.
    model : str
        Vendor and product, ``046d:081b``; empty where they are not known.
    place : str
        What the driver opens it by; changes when it is plugged in again.
    """

    identity: str
    name: str
    model: str
    place: str


@dataclass(frozen=True, slots=True)
class Format:
    """How a camera sends its pictures.

    Attributes
    ----------
    code : str
        Four characters, such as ``YUYV`` or ``MJPG``.
    width, height : int
        In pixels.
    rate_hz : float
        Pictures per second.
    """

    code: str
    width: int
    height: int
    rate_hz: float

    @property
    def compressed(self) -> bool:
        """Whether the pictures lose what JPEG loses."""
        return self.code not in UNCOMPRESSED

    def __str__(self) -> str:
        """Return it for people."""
        text = tr("{code} {w} x {h} at {hz:g} pictures/s")
        return text.format(code=self.code, w=self.width, h=self.height, hz=self.rate_hz)


class OpenCamera(Protocol):
    """A camera that delivers. Pictures are taken by one thread, settings by any."""

    @property
    def format(self) -> Format:
        """The format as read back, which need not be the one that was asked for."""

    def read(self) -> tuple[NDArray[np.uint8], float] | None:
        """Wait for the next picture; (height, width, 3) RGB, and when it came (monotonic, s).

        None where none has come in the driver's own time.

        Raises
        ------
        CameraGone
            If there will be no more.
        """

    def controls(self) -> tuple[Setting, ...]:
        """Return what can be set, as the camera tells it now."""

    def set(self, key: str, value: float) -> None:
        """Ask for a value; only :meth:`controls` tells what became of it.

        Raises
        ------
        InputError
            If the camera refuses aloud.
        """

    def close(self) -> None:
        """Give it back."""


class CameraDriver(Protocol):
    """Finds and opens cameras; may be asked by any thread."""

    def devices(self) -> tuple[Device, ...]:
        """Return the cameras that are plugged in."""

    def formats(self, device: Device) -> tuple[Format, ...]:
        """Return the formats that a camera lists; none where the system does not tell them."""

    def open(self, device: Device, wanted: Format | None) -> OpenCamera:
        """Open a camera, which may take seconds; None: as the camera comes.

        Raises
        ------
        CameraGone
            If it is not there or in use.
        """


def find_device(devices: tuple[Device, ...], identity: str, model: str) -> Device | None:
    """Return the camera that was meant; where it moved, the only one of its make."""
    for device in devices:
        if device.identity == identity:
            return device
    alike = [device for device in devices if model and device.model == model]
    return alike[0] if len(alike) == 1 else None


def best_format(formats: tuple[Format, ...], size: tuple[int, int] | None = None) -> Format | None:
    """Return the format to calibrate with, of those that a camera lists.

    Of the size asked for, where there is one; then uncompressed; then the largest that comes at
    five pictures a second at least; then the fastest.
    """
    usable = [f for f in formats if f.code in UNCOMPRESSED + COMPRESSED]
    if not usable:
        return None

    def rank(f: Format) -> tuple[bool, bool, bool, int, int, int, float]:
        fits = size is None or (f.width, f.height) == size
        order = (UNCOMPRESSED + COMPRESSED).index(f.code)
        return (
            fits,
            not f.compressed,
            f.rate_hz >= 5.0,
            f.width * f.height,
            f.width,
            -order,
            f.rate_hz,
        )

    return max(usable, key=rank)


def compression_warning(chosen: Format, offered: tuple[Format, ...]) -> str:
    """Return what speaks against a format in one sentence; empty where nothing does."""
    if not chosen.compressed:
        return ""
    if any(not f.compressed for f in offered):
        return tr(
            "{code} pictures are compressed and can be wrong by up to 19 grey levels: choose an"
            " uncompressed format to calibrate, even a slower one."
        ).format(code=chosen.code)
    return tr(
        "This camera has compressed pictures only ({code}), which can be wrong by up to 19 grey"
        " levels: average many frames, and expect more noise in the depth."
    ).format(code=chosen.code)
