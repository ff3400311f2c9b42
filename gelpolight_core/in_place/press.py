"""A first circle for a ball press, from its image and the background."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.reconstruction.in_place.change import Reference
from gelpolight_core.reflectance.ball_detection import detect_ball
from gelpolight_core.reflectance.contour import Circle

Map = NDArray[np.float32]


def find_contact(
    image: Map, base: Reference, *, ball_radius: float | None, name: str
) -> tuple[Circle, tuple[float, ...]]:
    """Return the contact's edge in an image, also where the border cuts it.

    Parameters
    ----------
    image : (rows, columns, 3) float32
        Linear light on the working grid.
    base : Reference
        The untouched membrane.
    ball_radius : float or None
        Of the ball, nodes, where it is known.
    name : str
        Name of the image in messages.

    Returns
    -------
    circle : Circle
        The edge, nodes.
    stretches : tuple of float
        Logarithm of its height over its width, by the edge and by the shading.

    Raises
    ------
    InputError
        If the image shows no ball.
    """
    found = detect_ball(
        image, base.background, markers=base.markers, ball_radius_px=ball_radius, name=name
    )
    if found.indentation is None:
        assert found.refusal is not None
        raise found.refusal
    indentation = found.indentation
    return Circle(*indentation.centre, indentation.contact_radius_px), indentation.stretches
