"""The overlay on an image, as plain data.

Positions are image pixels (u, v) with pixel centres at integers, as everywhere in the core.
An item with a `handle` can be dragged; :class:`app.live.live_view.LiveView` reports the new
position. Items with an array are equal only to themselves, because comparing arrays is slow.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Role = Literal["good", "bad", "expected", "led0", "led1", "led2", "info"]
MarkerKind = Literal["cross", "dot", "ring", "plus"]


@dataclass(frozen=True, slots=True)
class OverlayMarker:
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
class OverlayCircle:
    """A circle in the image. With a `handle` it can be moved and resized."""

    u: float
    v: float
    radius_px: float
    role: Role
    handle: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class OverlayLine:
    """A line through `points` (N, 2) of (u, v). `closed` joins the last to the first.

    Its role may also be a colour, #rrggbb.
    """

    points: NDArray[np.float64]
    role: str
    closed: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class OverlayMask:
    """Pixels, `area` (rows, columns) bool of the image's size, shown as a tint."""

    area: NDArray[np.bool_]
    role: Role


@dataclass(frozen=True, slots=True)
class OverlayRing:
    """A ring that fills, by its `share` 0..1, while an object is held still."""

    u: float
    v: float
    radius_px: float
    share: float


@dataclass(frozen=True, slots=True)
class ImageOverlay:
    """Everything that is drawn on one image."""

    markers: tuple[OverlayMarker, ...] = ()
    circles: tuple[OverlayCircle, ...] = ()
    lines: tuple[OverlayLine, ...] = ()
    masks: tuple[OverlayMask, ...] = ()
    rings: tuple[OverlayRing, ...] = ()

    def __add__(self, other: ImageOverlay) -> ImageOverlay:
        """Return an overlay with the items of both."""
        return ImageOverlay(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(self)))


RING_OF_HEIGHT = 0.25
RING_GAP = 1.25


def hold_ring(
    overlay: ImageOverlay, size: tuple[int, int], share: float
) -> tuple[OverlayRing, ...]:
    """Return a ring around the detected object, or in the middle. `share` 0: no ring."""
    if share <= 0.0:
        return ()
    max_radius_px = RING_OF_HEIGHT * size[1]
    for circle in overlay.circles:
        return (
            OverlayRing(circle.u, circle.v, min(RING_GAP * circle.radius_px, max_radius_px), share),
        )
    for line in overlay.lines:
        if line.role == "good" and len(line.points):
            u, v = line.points.mean(axis=0)
            radius_px = float(np.hypot(*(line.points - (u, v)).T).max())
            return (
                OverlayRing(float(u), float(v), min(RING_GAP * radius_px, max_radius_px), share),
            )
    return (OverlayRing(0.5 * size[0], 0.5 * size[1], 0.5 * max_radius_px, share),)
