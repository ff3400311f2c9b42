"""What is drawn over a picture, as plain data.

Positions are picture pixels (u, v) with pixel centres at whole numbers, as everywhere in the core.
An item with a `handle` can be dragged; :class:`app.live.live_view.LiveView` tells where it went.
Items that hold an array are equal to themselves only, for arrays are not compared at a glance.
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
    """A point, drawn at one size whatever the zoom.

    Attributes
    ----------
    u, v : float
        Where.
    kind : str
        Its shape.
    role : str
        What it means.
    text : str
        Written beside it.
    handle : str
        Its name for dragging; empty where it stays put.
    """

    u: float
    v: float
    kind: MarkerKind
    role: Role
    text: str = ""
    handle: str = ""


@dataclass(frozen=True, slots=True)
class Circle:
    """A circle in the picture; with a `handle` it can be moved and resized."""

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
    """Pixels, `area` (rows, columns) bool of the picture's size, shown as a tint."""

    area: NDArray[np.bool_]
    role: Role


@dataclass(frozen=True, slots=True)
class Note:
    """A line of text in the corner of the view."""

    text: str
    role: Role


@dataclass(frozen=True, slots=True)
class Overlay:
    """Everything that is drawn over one picture."""

    markers: tuple[Marker, ...] = ()
    circles: tuple[Circle, ...] = ()
    lines: tuple[Line, ...] = ()
    masks: tuple[Mask, ...] = ()
    notes: tuple[Note, ...] = ()
