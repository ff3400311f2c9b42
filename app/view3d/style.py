"""How the 3D view is drawn, as values: style, view directions, text colours."""

from __future__ import annotations

from dataclasses import dataclass

from gelpolight_core.fields import switch

Vector = tuple[float, float, float]

VIEWS: dict[str, tuple[Vector, Vector]] = {
    "isometric": ((-0.55, -1.0, 0.8), (0.0, 0.0, 1.0)),
    "top": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    "front": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    "side": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
}
"""Direction from surface to camera, and up direction. Front is the lower edge of the image."""


@dataclass(frozen=True, slots=True)
class Style:
    """The style of the 3D view.

    Attributes
    ----------
    exaggeration : float
        Scale of the drawn depth. Ticks and picked values stay true.
    axes, colour_bar, orientation, scale_bar, wireframe : bool
        Whether they are drawn.
    parallel : bool
        Parallel instead of perspective projection.
    """

    exaggeration: float = 1.0
    axes: bool = switch(True, "", "Axes in mm")
    colour_bar: bool = switch(True, "", "Colour bar")
    orientation: bool = switch(True, "", "Orientation widget")
    scale_bar: bool = switch(False, "", "Scale bar")
    wireframe: bool = switch(False, "", "Wireframe")
    parallel: bool = switch(False, "", "Parallel projection")


@dataclass(frozen=True, slots=True)
class Ink:
    """Colours of the background, from bottom to top, and of text, and the size of letters."""

    low: str = "white"
    high: str = "white"
    text: str = "black"
    font: int = 11
