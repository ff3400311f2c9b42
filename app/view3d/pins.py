"""Pins that the user set on the surface, and their measurements."""

from __future__ import annotations

from app.view3d.picking import Point, between
from app.view3d.surface import Surface
from app.widgets.units import in_unit
from gelpolight_core.translation import tr

PIN_NAMES = ("A", "B")


def with_pin(pins: tuple[Point, ...], point: Point) -> tuple[Point, ...]:
    """Return the pins with one more. A third pin replaces the oldest."""
    return (*pins, point)[-len(PIN_NAMES) :]


def pins_text(surface: Surface, pins: tuple[Point, ...]) -> str:
    """Return position and depth of each pin, and the measurements between two, one line each."""
    lines = [
        tr("{name}: x {x:.2f} mm  y {y:.2f} mm  depth {d}").format(
            name=name, x=x, y=y, d=in_unit(float(surface.depth_at([x], [y])[0]))
        )
        for name, (x, y) in zip(PIN_NAMES, pins, strict=False)
    ]
    found = between(surface, *pins) if len(pins) == len(PIN_NAMES) else None
    if found is not None:
        lines += [
            tr("distance {d}, across {a}").format(
                d=in_unit(found.distance_mm), a=in_unit(found.across_mm)
            ),
            tr("height difference {h}, angle {a:.1f}°").format(
                h=in_unit(found.rise_mm, sign="+"), a=found.angle_deg
            ),
        ]
    return "\n".join(lines)
