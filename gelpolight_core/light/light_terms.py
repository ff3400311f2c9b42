"""What changes the light of a real sensor: each effect is a term, in a module of its own.

Without any term, the LEDs are Lambertian and face the membrane, the gel is clear, and the
coating's reflectance does not depend on its stretch. A term that a sensor does not need is absent.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.channels import CHANNEL_KEYS

from .coating_stretch import STRETCH
from .gel_absorption import ABSORPTION
from .led_lobe import LOBE
from .light_term import LightTerm

LIGHT_TERMS: tuple[LightTerm, ...] = (LOBE, ABSORPTION, STRETCH)
"""All terms of the light that a sensor may need."""
LEAST_SLANT = 0.1
"""Least z of a normal for which the stretch is computed: steeper walls are hardly seen."""


class LightTerms:
    """The terms of one sensor with their values.

    Parameters
    ----------
    values : mapping
        Value of each parameter by its `full_key`; terms without values are absent.

    Examples
    --------
    >>> LightTerms({}).by_place
    False
    >>> LightTerms({"stretch_loss": 0.1}).reflectance(np.array([1.0, 2.0]))
    array([1. , 0.9])
    """

    def __init__(self, values: Mapping[str, float]) -> None:
        self._values = values
        self._used = [
            (term, np.array([values[p.full_key] for p in term.parameters]))
            for term in LIGHT_TERMS
            if all(p.full_key in values for p in term.parameters)
        ]

    def check(self) -> None:
        """Refuse values that no sensor has, and parts of a term.

        Raises
        ------
        ValueError
            With the first of them.
        """
        whole = {p.full_key for term, _ in self._used for p in term.parameters}
        if lone := sorted(self._values.keys() - whole):
            raise ValueError(f"{lone[0]} is no term of the light, or a part of one")
        for term, values in self._used:
            for parameter, value in zip(term.parameters, values.tolist(), strict=True):
                low, high = parameter.limits
                if not low <= value <= high:
                    raise ValueError(f"the {parameter.name} is {value}")

    @property
    def by_place(self) -> bool:
        """Whether any term changes the light at a place, whatever the normal is."""
        return any(t.from_leds is not None or t.loss_per_mm is not None for t, _ in self._used)

    @property
    def loss_per_mm(self) -> Float64Array:
        """Loss of light along a path through the gel, (3,)."""
        losses = [term.loss_per_mm(x) for term, x in self._used if term.loss_per_mm is not None]
        return np.asarray(sum(losses, np.zeros(len(CHANNEL_KEYS))))

    def from_leds(self, leds_mm: Float64Array, points_mm: NDArray[np.floating]) -> Float64Array:
        """Return the factor (..., 3) on the light of LEDs (3, 3) at points (..., 3)."""
        points = np.asarray(points_mm, np.float64)
        towards = points[..., None, :] - leds_mm
        factor = np.exp(-self.loss_per_mm * np.linalg.norm(towards, axis=-1))
        for term, x in self._used:
            if term.from_leds is not None:
                factor *= term.from_leds(x, leds_mm, points)
        return np.asarray(factor)

    def to_camera(self, nearer_mm: NDArray[np.floating]) -> Float64Array:
        """Return the factor (..., 3) on light to the camera, whose path is shorter by (...) mm."""
        return np.asarray(np.exp(self.loss_per_mm * nearer_mm[..., None]))

    def seen(
        self, nearer_mm: NDArray[np.floating], normals_z: NDArray[np.floating], rest_z: Any = -1.0
    ) -> Float64Array:
        """Return the factor (..., 3) on all light that a pressed membrane sends to the camera.

        Parameters
        ----------
        nearer_mm : (...)
            How much shorter the path to the camera is than at rest.
        normals_z, rest_z : (...)
            z of the unit normal, pressed and at rest. The membrane moves along z: its area grows by
            their ratio.
        """
        area = rest_z / np.minimum(normals_z, -LEAST_SLANT)
        return np.asarray(self.to_camera(nearer_mm) * self.reflectance(area)[..., None])

    def reflectance(self, area: NDArray[np.floating]) -> Float64Array:
        """Return the factor (...) on the reflectance of a coating stretched to (...) areas."""
        factor = np.ones(area.shape)
        for term, x in self._used:
            if term.reflectance is not None:
                factor *= term.reflectance(x, np.asarray(area, np.float64))
        return factor

    @property
    def stretch_loss(self) -> float:
        """Loss of reflectance by area, for compiled code, which has this law."""
        return self._values.get(STRETCH.parameters[0].key, 0.0)
