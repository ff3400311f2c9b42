"""What every source of pictures offers, be it a camera, the virtual sensor or a folder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError

Rgb = NDArray[np.uint8] | NDArray[np.uint16]


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture of a source. Its memory is never written again.

    Attributes
    ----------
    rgb : (rows, columns, 3) uint8 or uint16
        Red, green, blue; full scale is 255 or 65535. Made read-only.
    number : int
        From 0; counts every frame that the source made, so that gaps are frames lost.
    time_s : float
        When it was made, on the clock of ``time.monotonic``.
    settled : bool
        False while the picture does not yet show what the source was last told (a setting that has
        not taken effect, a picture that is still being rendered).
    """

    rgb: Rgb
    number: int
    time_s: float
    settled: bool = True

    def __post_init__(self) -> None:
        """Refuse what is no colour picture, and lock its memory."""
        if self.rgb.ndim != 3 or self.rgb.shape[2] != 3:
            raise ValueError(f"a frame has the shape (rows, columns, 3), not {self.rgb.shape}")
        if self.rgb.dtype not in (np.uint8, np.uint16):
            raise ValueError(f"a frame holds uint8 or uint16, not {self.rgb.dtype}")
        self.rgb.flags.writeable = False


@dataclass(frozen=True, slots=True)
class Setting:
    """One thing that can be set on a source.

    Attributes
    ----------
    key : str
        Name in files and calls, such as ``exposure_ms``.
    label, unit : str
        What people read.
    low, high, step : float
        Range, and the step that the source can make.
    value : float
        As read back from the source.
    writable : bool
        Whether :meth:`Source.set` may change it now.
    """

    key: str
    label: str
    unit: str
    low: float
    high: float
    step: float
    value: float
    writable: bool = True

    def nearest(self, value: float) -> float:
        """Return the nearest value that can be set."""
        steps = round((value - self.low) / self.step) if self.step > 0.0 else 0
        wanted = self.low + steps * self.step if self.step > 0.0 else value
        # Ten digits hide the binary tail of a step such as 0.1.
        return round(min(max(wanted, self.low), self.high), 10)


class SourceLost(InputError):
    """A source that gives no more pictures: it stopped, was unplugged, or came to its end."""


class SourceAway(Exception):
    """No pictures for now: the source tries by itself to go on. Its text is a whole sentence."""


class Source(Protocol):
    """A source of pictures.

    `open`, `frame` and `close` are called by one thread, that of the stream; `settings` and `set`
    may be called by any thread while the source is open.
    """

    @property
    def name(self) -> str:
        """What people call it."""

    @property
    def kind(self) -> str:
        """One of "virtual", "folder", "recording", "camera"."""

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels; valid once open."""

    def open(self) -> None:
        """Get ready to deliver, from the beginning; harmless when it is open.

        Raises
        ------
        InputError
            If it cannot be opened.
        """

    def frame(self, timeout_s: float) -> Frame | None:
        """Wait for the next frame; None if there is none in time.

        Raises
        ------
        SourceAway
            If there are none for now; after `timeout_s`, so that it can be asked at once again.
        SourceLost
            If there will be no more frames.
        InputError
            If a picture cannot be used.
        """

    def settings(self) -> tuple[Setting, ...]:
        """Return what can be set, with the values of now."""

    def set(self, key: str, value: float) -> float:
        """Change a setting; return what the source has really set.

        Raises
        ------
        InputError
            If there is no such setting or it cannot be changed.
        """

    def close(self) -> None:
        """Give everything back, within a second; harmless when it is closed."""


@dataclass(frozen=True, slots=True)
class SourceInfo:
    """A source that can be chosen.

    Attributes
    ----------
    kind, name, detail : str
        What is shown; `detail` says what tells it from others of its kind.
    open : callable
        Returns the source, quick and not yet open: the stream's own thread opens it.
    file : Path or None
        The folder or recording that plays it; None of what is no file.
    """

    kind: str
    name: str
    detail: str
    open: Callable[[], Source]
    file: Path | None = None
