"""Pins that the user set on the surface, and their measurements."""

from __future__ import annotations

from app.view3d.picking import Point, between
from app.view3d.surface import Surface
from gelpolight_core.translation import tr

PIN_NAMES = ("A", "B")


def with_pin(pins: tuple[Point, ...], point: Point) -> tuple[Point, ...]:
    """Return the pins with one more. A third pin replaces the oldest."""
    return (*pins, point)[-len(PIN_NAMES) :]


def pins_text(surface: Surface, pins: tuple[Point, ...]) -> str:
    """Return position and depth of each pin, and the measurements between two, one line each."""
    lines = [
        tr("{name}: x {x:.2f}  y {y:.2f}  depth {d:.3f} mm").format(
            name=name, x=x, y=y, d=float(surface.depth_at([x], [y])[0])
        )
        for name, (x, y) in zip(PIN_NAMES, pins, strict=False)
    ]
    found = between(surface, *pins) if len(pins) == len(PIN_NAMES) else None
    if found is not None:
        lines += [
            tr("distance {d:.3f} mm, across {a:.3f} mm").format(
                d=found.distance_mm, a=found.across_mm
            ),
            tr("height difference {h:+.3f} mm, angle {a:.1f}°").format(
                h=found.rise_mm, a=found.angle_deg
            ),
        ]
    return "\n".join(lines)
