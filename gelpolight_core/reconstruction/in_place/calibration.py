"""The calibration of a closed sensor: all data for the reconstruction of its images."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.bad_pixels import BadPixels, no_bad_pixels
from gelpolight_core.errors import InputError
from gelpolight_core.finding import QualityTable, Verdict, failure, worst_verdict
from gelpolight_core.image.response import CameraResponse
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.reconstruction.in_place.grid import ImageSize, WorkingGrid
from gelpolight_core.reconstruction.in_place.model import COLOUR_CELLS, ErrorCurve, InPlaceModel
from gelpolight_core.reconstruction.in_place.terms import TERMS
from gelpolight_core.sensor_calibration import Calibration, Provenance
from gelpolight_core.translation import tr

MODEL = "in-place"
UNKNOWN = ("optics", "refraction", "temperature")
"""Quantities that in-place calibration cannot determine."""


@dataclass(frozen=True, slots=True)
class ClosedSensor:
    """The stated data of a closed sensor."""

    serial: str


@dataclass(frozen=True)
class InPlaceCalibration:
    """All known data of a closed sensor.

    Attributes
    ----------
    sensor : ClosedSensor
        As stated.
    in_place : InPlaceModel
        Background, scale and slopes.
    noise : (3,)
        Standard deviation of a pixel of a single image, per channel.
    balls : tuple of tuple
        Name, x and y of the centre, contact radius and ball radius of each press used, in mm.
    quality : mapping
        Quality table of every stage, in their order.
    provenance : Provenance
        When, who, from what.
    response : CameraResponse or None
        As declared; None where images are used as they are.
    """

    sensor: ClosedSensor
    in_place: InPlaceModel
    noise: NDArray[np.float64]
    balls: tuple[tuple[str, float, float, float, float], ...]
    quality: Mapping[str, QualityTable]
    provenance: Provenance
    response: CameraResponse | None = None
    model: str = field(default=MODEL, init=False)

    @property
    def camera(self) -> ImageSize:
        """Size of the camera's images."""
        return self.in_place.grid.image

    @cached_property
    def table(self) -> ResamplingTable:
        """The camera pixel of each node."""
        return self.in_place.grid.table()

    @cached_property
    def bad_pixels(self) -> BadPixels:
        """None: those of a closed sensor are not looked for."""
        return no_bad_pixels(self.camera.height, self.camera.width)

    @cached_property
    def identity(self) -> str:
        """A short name that changes with any number that a reconstruction uses."""
        model = self.in_place
        digest = hashlib.sha256(repr((self.sensor, model.grid, model.follow_gain)).encode())
        arrays = [model.background, model.coefficients, model.seen_colours]
        arrays += [model.errors.slopes, model.errors.slope_sd]
        if self.response is not None:
            arrays.append(self.response.curves)
        for array in arrays:
            digest.update(np.ascontiguousarray(array).tobytes())
        return f"{self.sensor.serial}-{digest.hexdigest()[:12]}"

    @property
    def verdict(self) -> Verdict:
        """The worst verdict of all stages."""
        return worst_verdict(self.quality)

    @property
    def fault(self) -> str:
        """Why no measurement with it is reliable, as a clause; empty if it did not fail."""
        return failure(self.quality)


AnyCalibration = Calibration | InPlaceCalibration
"""Of an open or of a closed sensor."""


def require_open(calibration: AnyCalibration, *, where: str) -> Calibration:
    """Return a calibration with optics and lights.

    Raises
    ------
    InputError
        If it is of a closed sensor.
    """
    if isinstance(calibration, InPlaceCalibration):
        raise InputError(
            tr("The calibration is of a closed sensor: its optics and lights are unknown"),
            where=where,
            advice=tr("Use the calibration of an open sensor here"),
        )
    return calibration


def in_place_arrays(c: InPlaceCalibration) -> dict[str, NDArray[Any]]:
    """Return the arrays of a closed sensor's calibration by their names in the file."""
    model = c.in_place
    arrays: dict[str, NDArray[Any]] = {
        "background": model.background,
        "slope_coefficients": model.coefficients,
        "seen_colours": model.seen_colours,
        "error_slopes": model.errors.slopes,
        "error_slope_sd": model.errors.slope_sd,
        "noise": c.noise,
    }
    if c.response is not None:
        arrays["camera_response"] = c.response.curves
    return arrays


def in_place_entry(c: InPlaceCalibration) -> dict[str, Any]:
    """Return the manifest entries of a closed sensor's calibration."""
    model = c.in_place
    grid = model.grid
    usual = WorkingGrid(grid.image, grid.mm_per_px)
    unusual = {} if grid == usual else {"aspect": grid.aspect, "region_px": grid.region_px}
    return {
        "sensor": {"serial": c.sensor.serial},
        "camera": {"width": c.camera.width, "height": c.camera.height},
        "in_place": {
            "mm_per_px": grid.mm_per_px,
            **unusual,
            "scale_sd": model.scale_sd,
            "steepest_slope": model.steepest,
            "follow_gain": model.follow_gain,
            "depth_share_sd": model.errors.depth_share,
            "depth_floor_mm": model.errors.depth_floor_mm,
            "unknown": list(UNKNOWN),
            "balls": [list(ball) for ball in c.balls],
        },
    }


def read_in_place(
    manifest: Mapping[str, Any],
    arrays: Mapping[str, NDArray[Any]],
    quality: Mapping[str, QualityTable],
    provenance: Provenance,
) -> InPlaceCalibration:
    """Return the closed sensor's calibration of a file, with all values checked.

    Raises
    ------
    ValueError
        If a value is missing or is one that no calibration has.
    """
    camera, entry = manifest["camera"], manifest["in_place"]
    size = ImageSize(camera["width"], camera["height"])
    if not all(type(n) is int and 32 <= n <= 20_000 for n in (size.width, size.height)):
        raise ValueError("the image size is not possible")
    scale, aspect = _number(entry["mm_per_px"], 1e-5, 100.0), entry.get("aspect", 1.0)
    region = entry.get("region_px")
    cut: Any = None if region is None else tuple(map(int, region))
    grid = WorkingGrid(size, scale, _number(aspect, 1e-7, 1e7), cut)
    errors = ErrorCurve(
        arrays["error_slopes"],
        arrays["error_slope_sd"],
        _number(entry["depth_share_sd"], 0.0, 1e3),
        _number(entry["depth_floor_mm"], 0.0, 1e3),
    )
    response = arrays.get("camera_response")
    calibration = InPlaceCalibration(
        sensor=ClosedSensor(str(manifest["sensor"]["serial"])),
        in_place=InPlaceModel(
            grid,
            arrays["background"],
            arrays["slope_coefficients"],
            arrays["seen_colours"],
            _number(entry["steepest_slope"], 1e-6, 1e3),
            errors,
            bool(entry["follow_gain"]),
            _number(entry["scale_sd"], 0.0, 1.0),
        ),
        noise=arrays["noise"],
        balls=tuple(_ball(row) for row in entry["balls"]),
        quality=quality,
        provenance=provenance,
        response=None if response is None else CameraResponse(response.astype(np.float64)),
    )
    _check_arrays(calibration)
    return calibration


def _ball(row: list[Any]) -> tuple[str, float, float, float, float]:
    x, y, contact, radius = (_number(value, -1e4, 1e4) for value in row[1:])
    return str(row[0]), x, y, contact, radius


def _number(value: Any, low: float, high: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise ValueError(f"{value!r} is not possible")
    return float(value)


def _check_arrays(c: InPlaceCalibration) -> None:
    model = c.in_place
    nodes = model.errors.slopes
    expected: dict[str, tuple[NDArray[Any], tuple[int, ...], type]] = {
        "background": (model.background, (*model.grid.shape, 3), np.float32),
        "slope_coefficients": (model.coefficients, (TERMS, 2), np.float64),
        "seen_colours": (model.seen_colours, (COLOUR_CELLS,) * 3, np.float32),
        "error_slopes": (nodes, nodes.shape, np.float64),
        "error_slope_sd": (model.errors.slope_sd, nodes.shape, np.float64),
        "noise": (c.noise, (3,), np.float64),
    }
    for name, (array, shape, kind) in expected.items():
        if array.shape != shape or array.dtype != kind or not np.isfinite(array).all():
            raise ValueError(f"{name} has impossible values")
    if nodes.ndim != 1 or nodes.size < 2 or not (np.diff(nodes) > 0.0).all():
        raise ValueError("the errors are not given over rising slopes")
    if float(model.errors.slope_sd.min()) < 0.0 or float(model.background.min()) < 0.0:
        raise ValueError("an error or a background is negative")
