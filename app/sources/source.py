"""The interface of image sources: cameras, the virtual sensor, folders and recordings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from gelpolight_core.base.arrays import PixelArray
from gelpolight_core.base.errors import InputError, Remedy


@dataclass(frozen=True, slots=True)
class SourceFrame:
    """One image of a source. Its memory is never changed.

    Attributes
    ----------
    rgb : (rows, columns, 3) uint8 or uint16
        Red, green, blue; full scale is 255 or 65535. Made read-only.
    number : int
        From 0; counts every frame that the source made, so that gaps are lost frames.
    time_s : float
        Capture time, on the clock of ``time.monotonic``.
    settled : bool
        False while the image does not yet show the last change of the source (a setting that has
        no effect yet, an image that is still being rendered).
    index : int or None
        Index in the recording or folder that is played, which begins again in a loop. None for a
        live image.
    name : str
        File name of a stored image, after which exports of it are named. Empty for a live image.
    paused : bool
        Whether a stored image is shown by itself, and continues no other one.
    """

    rgb: PixelArray
    number: int
    time_s: float
    settled: bool = True
    index: int | None = None
    name: str = ""
    paused: bool = False

    def __post_init__(self) -> None:
        """Reject arrays that are not colour images, and make the memory read-only."""
        if self.rgb.ndim != 3 or self.rgb.shape[2] != 3:
            raise ValueError(
                f"a frame must have the shape (rows, columns, 3), not {self.rgb.shape}"
            )
        if self.rgb.dtype not in (np.uint8, np.uint16):
            raise ValueError(f"a frame must be uint8 or uint16, not {self.rgb.dtype}")
        self.rgb.flags.writeable = False


@dataclass(frozen=True, slots=True)
class SourceSetting:
    """One setting of a source.

    Attributes
    ----------
    key : str
        Name in files and calls, such as ``exposure_ms``.
    label, unit : str
        Label and unit shown to the user.
    low, high, step : float
        Range and step size of the source.
    value : float
        Value as read back from the source.
    writable : bool
        Whether it can be changed now.
    """

    key: str
    label: str
    unit: str
    low: float
    high: float
    step: float
    value: float
    writable: bool = True


class SourceLost(InputError):
    """The source gives no more images: it stopped, was unplugged, or reached its end."""


def source_closed_error(where: str) -> SourceLost:
    """Return the refusal of a source that is not open."""
    return SourceLost("the source is closed", where, Remedy.OPEN_AGAIN)


class SourceUnavailable(SourceLost):
    """No images for now: the source tries to reconnect. Its text is a complete sentence."""

    def __init__(self, sentence: str) -> None:
        super().__init__(sentence, "", "")

    def __str__(self) -> str:
        """Return the sentence."""
        return self.found


class Source(Protocol):
    """An image source.

    `open`, `frame` and `close` are called by one thread, that of the stream; `settings` by any
    thread while the source is open.
    """

    @property
    def name(self) -> str:
        """Name shown to the user."""

    @property
    def kind(self) -> str:
        """One of "virtual", "folder", "recording", "camera"."""

    def open(self) -> None:
        """Prepare to deliver from the start, unless it is open.

        Raises
        ------
        InputError
            If the source cannot be opened.
        """

    def frame(self, timeout_s: float) -> SourceFrame | None:
        """Wait for the next frame. None: none arrived in time.

        Raises
        ------
        SourceUnavailable
            If there are none for now; raised after `timeout_s`, so that the caller can retry at
            once.
        SourceLost
            If there will be no more frames.
        InputError
            If an image cannot be used.
        """

    def settings(self) -> tuple[SourceSetting, ...]:
        """Return the settings with their present values."""

    def close(self) -> None:
        """Release all resources within a second, unless it is closed."""


@dataclass(frozen=True, slots=True)
class SourceInfo:
    """A source that can be selected.

    Attributes
    ----------
    kind, name, detail : str
        Texts for the list; `detail` distinguishes sources of the same kind.
    open : callable
        Creates the source quickly, not yet open: the stream's own thread opens it.
    file : Path or None
        Its folder or recording; None if it is not a file.
    """

    kind: str
    name: str
    detail: str
    open: Callable[[], Source]
    file: Path | None = None
