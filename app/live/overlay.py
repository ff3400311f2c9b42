"""The overlay on an image, as plain data.

Positions are image pixels (u, v) with pixel centres at integers, as everywhere in the core.
An item with a `handle` can be dragged; :class:`app.live.live_view.LiveView` reports the new
position. Items with an array are equal only to themselves, because comparing arrays is slow.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Role = Literal["good", "bad", "expected", "led0", "led1", "led2", "info"]
MarkerKind = Literal["cross", "dot", "ring", "plus"]


@dataclass(frozen=True, slots=True)
class Marker:
    """A point, drawn at the same size at any zoom.

    Attributes
    ----------
    u, v : float
        Position in pixels.
    kind : str
        Shape of the point.
    role : str
        Meaning of the point.
    text : str
        Text next to the point.
    handle : str
        Name for dragging; empty if the point cannot be moved.
    """

    u: float
    v: float
    kind: MarkerKind
    role: Role
    text: str = ""
    handle: str = ""


@dataclass(frozen=True, slots=True)
class Circle:
    """A circle in the image; with a `handle` it can be moved and resized."""

    u: float
    v: float
    radius_px: float
    role: Role
    handle: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A line through `points` (N, 2) of (u, v); `closed` joins the last to the first."""

    points: NDArray[np.float64]
    role: Role
    closed: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Mask:
    """Pixels, `area` (rows, columns) bool of the image's size, shown as a tint."""

    area: NDArray[np.bool_]
    role: Role


@dataclass(frozen=True, slots=True)
class Note:
    """A line of text in the corner of the view."""

    text: str
    role: Role


@dataclass(frozen=True, slots=True)
class Overlay:
    """Everything that is drawn on one image."""

    markers: tuple[Marker, ...] = ()
    circles: tuple[Circle, ...] = ()
    lines: tuple[Line, ...] = ()
    masks: tuple[Mask, ...] = ()
    notes: tuple[Note, ...] = ()
