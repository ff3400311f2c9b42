"""The membrane of the full model: a diffuse and a glossy share, and light from other parts of it.

The glossy share is a microfacet lobe (GGX distribution, Smith's masking) about the half vector
between light and view; the diffuse share is a power of the cosine, or a curve for each channel.
Together they give a brightness that depends on the viewing direction, like that of a real membrane.
Curves without gloss are the paper's one-dimensional table (Eq. 6).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from gelpolight_core.base.arrays import Float64Array

from .directions import light_directions
from .light_terms import LightTerms
from .membrane_brdf_kernel import brightness_of_points

# With this number of even cosines, linear interpolation is accurate to 1e-5 for any fitted or
# edited curve.
CURVE_NODES = 257


@dataclass(frozen=True, slots=True)
class MembraneBrdf:
    """Reflectance model of the membrane.

    Attributes
    ----------
    exponent : float
        Exponent of the diffuse share's cosine, 1 for a Lambertian membrane.
    gloss : float
        Share of the glossy lobe, 0..1.
    roughness : float
        GGX alpha of the glossy lobe.
    interreflection : float
        Reflectance for light from other parts of the membrane, in units of the reflectance that
        :meth:`response` describes; 0: no such light.
    diffuse : tuple of 3 tuples of `CURVE_NODES` floats
        The diffuse share of each channel at even cosines from 0 to 1, instead of
        ``cosine**exponent``; empty if the power is used.
    terms : mapping
        Values of the terms of the light that the sensor needs, for :class:`LightTerms`.
    """

    exponent: float = 1.0
    gloss: float = 0.0
    roughness: float = 0.5
    interreflection: float = 0.0
    diffuse: tuple[tuple[float, ...], ...] = ()
    terms: Mapping[str, float] = field(default_factory=dict, repr=False)

    def check(self) -> None:
        """Refuse values that no membrane has.

        Raises
        ------
        ValueError
            With the first of them.
        """
        lobes = self.exponent > 0.0 and 0.0 <= self.gloss < 1.0 and 0.0 < self.roughness <= 1.0
        if not lobes or self.interreflection < 0.0:
            raise ValueError("the membrane has impossible values")
        if self.diffuse:
            if [len(curve) for curve in self.diffuse] != [CURVE_NODES] * 3:
                raise ValueError("the membrane curves have another length")
            if self.curves.min() < 0.0 or (np.diff(self.curves, axis=1) < 0.0).any():
                raise ValueError("the membrane curves are not monotone")
            if not (self.curves[:, -1] > 0.0).all():
                raise ValueError("the membrane curves are dark")
        self.light.check()

    @property
    def light(self) -> LightTerms:
        """The terms of the light that the sensor needs."""
        return LightTerms(self.terms)

    @property
    def curves(self) -> Float64Array:
        """The diffuse curves, (3, `CURVE_NODES`), or (3, 0) if the power of the cosine is used."""
        return np.array(self.diffuse, np.float64).reshape(3, -1)

    def diffuse_share(self, cosine: Float64Array) -> Float64Array:
        """Return the diffuse brightness (..., 3) at each channel's cosine (..., 3), times pi."""
        if not self.diffuse:
            return np.asarray(cosine**self.exponent)
        even = np.linspace(0.0, 1.0, CURVE_NODES)
        return np.stack(
            [np.interp(cosine[..., k], even, curve) for k, curve in enumerate(self.diffuse)], -1
        )

    def response(
        self, light: Float64Array, normals: Float64Array, view: Float64Array
    ) -> Float64Array:
        """Return the brightness under each light, per unit of light (0 on the dark side).

        Parameters
        ----------
        light : (N, 3, 3)
            Unit directions to the three LEDs.
        normals, view : (N, 3)
            Unit normals, and unit directions to the camera inside the elastomer.

        Returns
        -------
        (N, 3)
        """
        result = np.empty(light.shape[:2])
        lobes = (self.exponent, self.gloss, self.roughness)
        light, normals, view = (
            np.require(part, np.float64, ["C", "W"]) for part in (light, normals, view)
        )
        brightness_of_points(light, normals, view, lobes, self.curves, result)
        return result

    def direct(
        self,
        leds_mm: Float64Array,
        points_mm: Float64Array,
        normals: Float64Array,
        view: Float64Array,
    ) -> Float64Array:
        """Return the direct light of points (..., 3), below 0 as the LEDs' z.

        It is that of a coating that is not stretched, with the path from the LEDs, but not that to
        the camera.

        Parameters
        ----------
        leds_mm : (3, 3)
            LED positions, sensor frame.
        points_mm, normals, view : (..., 3)
            Sensor frame; unit normals, and unit directions to the camera.
        """
        light, distance = light_directions(leds_mm, points_mm.reshape(-1, 3))
        normals = np.broadcast_to(normals, points_mm.shape).reshape(-1, 3)
        response = self.response(light, normals, view.reshape(-1, 3))
        direct = (response * light[..., 2] / distance**2).reshape(points_mm.shape)
        return direct * self.light.from_leds(leds_mm, points_mm) if self.terms else direct
