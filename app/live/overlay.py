"""The overlay on an image, as plain data.

Positions are image pixels (u, v) with pixel centres at integers, as everywhere in the core.
An item with a `handle` can be dragged; :class:`app.live.live_view.LiveView` reports the new
position. Items with an array are equal only to themselves, because comparing arrays is slow.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

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
    radius_px: ClassVar[float] = 0.0


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
    """A line through `points` (N, 2) of (u, v); `closed` joins the last to the first.

    Its role may also be a colour, #rrggbb.
    """

    points: NDArray[np.float64]
    role: str
    closed: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Mask:
    """Pixels, `area` (rows, columns) bool of the image's size, shown as a tint."""

    area: NDArray[np.bool_]
    role: Role


@dataclass(frozen=True, slots=True)
class Ring:
    """A ring that fills while an object is held still; `share` 0..1."""

    u: float
    v: float
    radius_px: float
    share: float


@dataclass(frozen=True, slots=True)
class Overlay:
    """Everything that is drawn on one image."""

    markers: tuple[Marker, ...] = ()
    circles: tuple[Circle, ...] = ()
    lines: tuple[Line, ...] = ()
    masks: tuple[Mask, ...] = ()
    rings: tuple[Ring, ...] = ()


RING_OF_HEIGHT = 0.25
RING_GAP = 1.25


def hold_ring(overlay: Overlay, size: tuple[int, int], share: float) -> tuple[Ring, ...]:
    """Return the ring around what was found, or in the middle of the image; none for `share` 0."""
    if share <= 0.0:
        return ()
    most = RING_OF_HEIGHT * size[1]
    for circle in overlay.circles:
        return (Ring(circle.u, circle.v, min(RING_GAP * circle.radius_px, most), share),)
    for line in overlay.lines:
        if line.role == "good" and len(line.points):
            u, v = line.points.mean(axis=0)
            reach = float(np.hypot(*(line.points - (u, v)).T).max())
            return (Ring(float(u), float(v), min(RING_GAP * reach, most), share),)
    return (Ring(0.5 * size[0], 0.5 * size[1], 0.5 * most, share),)


# Below this radius a circle could not be distinguished from its centre, or grabbed.
LEAST_RADIUS_PX = 1.0


Handle = Circle | Marker
"""What can be moved: an item with a name as its `handle`."""


def handles_of(overlay: Overlay) -> tuple[Handle, ...]:
    """Return all handles, in the order of the keyboard."""
    items: tuple[Handle, ...] = (*overlay.circles, *overlay.markers)
    return tuple(item for item in items if item.handle)


def find_grip(
    handles: Iterable[Handle], u: float, v: float, *, reach_px: float
) -> tuple[Handle, bool] | None:
    """Return the handle nearest to a point, and whether it is held at its rim, which resizes it.

    None if there is no handle within `reach_px`.
    """
    near: list[tuple[float, Handle, bool]] = []
    for handle in handles:
        away = math.hypot(handle.u - u, handle.v - v)
        near.append((away, handle, False))
        if handle.radius_px > 0.0:
            # The whole circle resizes, so that nobody has to aim at the small square.
            near.append((abs(away - handle.radius_px), handle, True))
    off, found, resizes = min(near, key=lambda item: item[0], default=(math.inf, None, False))
    return None if found is None or off > reach_px else (found, resizes)


def drag(
    handle: Handle,
    resizes: bool,
    start: tuple[float, float],
    now: tuple[float, float],
    size: tuple[int, int],
) -> Handle:
    """Return a handle after a drag from `start` to `now`; its centre stays in the image."""
    if resizes:
        centre = handle.u, handle.v
        return resize(handle, math.dist(now, centre) - math.dist(start, centre))
    return move(handle, now[0] - start[0], now[1] - start[1], size)


def move(handle: Handle, du: float, dv: float, size: tuple[int, int]) -> Handle:
    """Return a handle moved by pixels; its centre stays in the image of `size` (width, height)."""
    return replace(
        handle,
        u=min(max(handle.u + du, 0.0), size[0] - 1.0),
        v=min(max(handle.v + dv, 0.0), size[1] - 1.0),
    )


def resize(handle: Handle, by_px: float) -> Handle:
    """Return a circle with another radius; a marker has no radius and does not change."""
    if isinstance(handle, Marker):
        return handle
    return replace(handle, radius_px=max(handle.radius_px + by_px, LEAST_RADIUS_PX))


def next_name(handles: Sequence[Handle], name: str, step: int) -> str:
    """Return the name of the handle `step` positions after `name`, cyclically."""
    names = [handle.handle for handle in handles]
    if name not in names:
        return names[0 if step > 0 else -1] if names else ""
    return names[(names.index(name) + step) % len(names)]


def with_handle(overlay: Overlay, handle: Handle) -> Overlay:
    """Return an overlay with the item of that name moved to the handle."""

    def moved(items: tuple[Any, ...]) -> tuple[Any, ...]:
        return tuple(handle if item.handle == handle.handle else item for item in items)

    return replace(overlay, markers=moved(overlay.markers), circles=moved(overlay.circles))
