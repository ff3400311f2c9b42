"""The fitted indenters as measuring tools: ball, cylinder and cuboid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from gelpolight_core.measurement.measure import measure_object
from gelpolight_core.measurement.measured import Measured
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.measurement.tool import Point, ToolResult
from gelpolight_core.reconstruction.heightmap import HeightMap


def measure_heightmap(
    heightmap: HeightMap, *, shape: str, seed_mm: Point | None = None
) -> Measurement:
    """Measure the object that is pressed, with all that a height map knows.

    Parameters
    ----------
    heightmap : HeightMap
        Reconstructed with its uncertainty, where the result shall hold noise and calibration.
    shape, seed_mm
        As for :func:`~gelpolight_core.measurement.measure.measure_object`.

    Raises
    ------
    InputError
        As :func:`~gelpolight_core.measurement.measure.measure_object`.
    """
    return measure_object(
        heightmap.depth_mm,
        heightmap.x_mm,
        heightmap.y_mm,
        shape=shape,
        seed_mm=seed_mm,
        flags=heightmap.flags,
        noise_mm=heightmap.noise_mm,
        depth_scale_sd=heightmap.depth_scale_sd,
        lateral_scale_sd=heightmap.lateral_scale_sd,
    )


@dataclass(frozen=True, slots=True)
class Ball:
    """A ball, fitted with the drape around it.

    Attributes
    ----------
    at_mm : (float, float) or None
        A point on it; None where nothing else is pressed.
    """

    name: ClassVar[str] = "ball"
    at_mm: Point | None = None

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure."""
        fit = measure_heightmap(heightmap, shape=self.name, seed_mm=self.at_mm)
        return _fitted(self, fit)


@dataclass(frozen=True, slots=True)
class Cylinder:
    """A flat cylinder, fitted with the drape around it; attributes as for :class:`Ball`."""

    name: ClassVar[str] = "cylinder"
    at_mm: Point | None = None

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure."""
        fit = measure_heightmap(heightmap, shape=self.name, seed_mm=self.at_mm)
        return _fitted(self, fit)


@dataclass(frozen=True, slots=True)
class Cuboid:
    """A flat cuboid, fitted with the drape around it; attributes as for :class:`Ball`."""

    name: ClassVar[str] = "cuboid"
    at_mm: Point | None = None

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure."""
        fit = measure_heightmap(heightmap, shape=self.name, seed_mm=self.at_mm)
        return _fitted(self, fit)


def _fitted(tool: Ball | Cylinder | Cuboid, fit: Measurement) -> ToolResult:
    """Return a fit as a tool's result."""
    sizes: tuple[Measured, ...]
    if fit.side_mm is None:
        assert fit.diameter_mm is not None
        sizes = (Measured(fit.diameter_mm, fit.sd["diameter_mm"], "mm", "diameter"),)
    else:
        sizes = tuple(
            Measured(side, sd, "mm", name)
            for name, side, sd in zip(
                ("side_a", "side_b"), fit.side_mm, fit.sd["side_mm"], strict=True
            )
        )
    turned: tuple[Measured, ...] = ()
    if fit.yaw_deg is not None:
        turned = (Measured(fit.yaw_deg, fit.sd["yaw_deg"], "deg", "yaw"),)
    figures = (
        *sizes,
        Measured(fit.height_mm, fit.sd["height_mm"], "mm", "height"),
        Measured(fit.centre_mm[0], fit.sd["centre_mm"][0], "mm", "centre_x"),
        Measured(fit.centre_mm[1], fit.sd["centre_mm"][1], "mm", "centre_y"),
        *turned,
        Measured(fit.drape_decay_mm, fit.sd["drape_decay_mm"], "mm", "drape_decay"),
    )
    return ToolResult(tool, figures, (fit.outline_mm,), fit.verdict, fit.reason, measurement=fit)
