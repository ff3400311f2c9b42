"""View directions and text colours of the 3D view."""

from __future__ import annotations

from dataclasses import dataclass

Vector = tuple[float, float, float]

VIEWS: dict[str, tuple[Vector, Vector]] = {
    "isometric": ((-0.55, -1.0, 0.8), (0.0, 0.0, 1.0)),
    "top": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    "front": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    "side": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
}
"""Direction from surface to camera, and up direction. Front is the lower edge of the image."""


@dataclass(frozen=True, slots=True)
class SceneColours:
    """Colours of the background, from bottom to top, and of text, and the size of letters."""

    low: str = "white"
    high: str = "white"
    text: str = "black"
    font: int = 11
