"""From an image and the tools on it to figures. Runs in the background.

An image is read and reconstructed as ``gelpolight measure`` does it, so that both give the same
results.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from app.live.frame_processor import FrameResult
from app.program.display import DisplaySettings
from app.sources.source import SourceFrame
from app.views.map import shading
from app.views.map.quantities import depth_scale, difference_scale
from app.views.map.shading import map_image
from app.views.surface.display_surface import surface_of
from gelpolight_core.base.errors import InputError, Remedy, error_message
from gelpolight_core.base.finding import finding_from_error
from gelpolight_core.image.linear_image import LinearImage, linear_image
from gelpolight_core.image.response import CameraResponse
from gelpolight_core.measurement.fit_residual import fit_residual
from gelpolight_core.measurement.map_reliability import with_map_findings
from gelpolight_core.measurement.measurable_depth import measurable_depth
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.measurement.shape_detection import DetectedShape, detect_shape
from gelpolight_core.measurement.tools.tool_base import Tool, ToolResult
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.session.session_images import read_colours, require_colour

# Fine enough for any tool, and fast to build.
NODES = 400
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredImage:
    """An image file or a camera frame to measure on.

    Attributes
    ----------
    name : str
        Name shown to the user.
    path : Path or None
        Its file. None for a camera image.
    frame : SourceFrame or None
        The frame of the camera. None for a file.
    serial : str
        Serial of its sensor. Empty if unknown.
    time : datetime
        When it was frozen or opened.
    """

    name: str
    path: Path | None = None
    frame: SourceFrame | None = None
    serial: str = ""
    time: datetime = field(default_factory=lambda: datetime.now(UTC))

    def image(self, response: CameraResponse | None) -> LinearImage:
        """Return it as linear light.

        Raises
        ------
        InputError
            If the file cannot be used, or the image is greyscale.
        """
        if self.path is not None:
            return read_colours(self.path, response=response)
        assert self.frame is not None
        image = linear_image(self.frame.rgb, self.name, response=response)
        require_colour(image, where=self.name)
        return image


@dataclass(frozen=True, slots=True, eq=False)
class MeasureRequest:
    """An image with its tools, to be reconstructed and measured.

    Attributes
    ----------
    calibration : Calibration
        Calibration of the sensor.
    model : str
        The calibration's, or ``paper``.
    image : MeasuredImage
        The image.
    sheet : mapping of int to Tool
        The tools on it by their keys.
    display : DisplaySettings
        How the depth is shown.
    propose : bool
        Whether to detect the object.
    """

    calibration: Calibration
    model: str
    image: MeasuredImage
    sheet: Mapping[int, Tool]
    display: DisplaySettings
    propose: bool = False


@dataclass(frozen=True, slots=True)
class ToolOutcome:
    """The answer of a tool: its result, or why there is none. Neither while it is measured."""

    result: ToolResult | None = None
    refused: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class ImageResults:
    """The depth of an image, and the answers of the tools on it.

    Attributes
    ----------
    heightmap : HeightMap
        Depth of the image, with its uncertainty.
    shown : FrameResult
        How it is shown.
    answers : mapping of int to ToolOutcome
        By the tools' keys.
    proposal : DetectedShape or None
        The detected object, if requested and found.
    """

    heightmap: HeightMap
    shown: FrameResult
    answers: Mapping[int, ToolOutcome] = field(default_factory=lambda: MappingProxyType({}))
    proposal: DetectedShape | None = None


class MeasurementEngine:
    """Answers requests, and keeps what does not change between them.

    Used by one thread at a time. None instead of a request clears all kept data.
    """

    def __init__(self) -> None:
        self._forget()

    def _forget(self) -> None:
        self._reconstructor: Reconstructor | None = None
        self._image: MeasuredImage | None = None
        self._depth: tuple[HeightMap, NDArray[np.uint8]] | None = None
        self._shown: tuple[DisplaySettings, FrameResult] | None = None
        self._answers: dict[Tool, ToolOutcome] = {}

    def __call__(self, request: MeasureRequest | None) -> ImageResults | None:
        """Measure.

        Raises
        ------
        InputError
            If the image cannot be used, or does not fit the calibration's sensor or size.
        """
        if request is None:
            self._forget()
            return None
        heightmap, shown = self._depth_of(request)
        answers = {}
        for key, tool in request.sheet.items():
            if tool not in self._answers:
                self._answers[tool] = apply_tool(tool, heightmap)
            answers[key] = self._answers[tool]
        proposal = detect_shape(heightmap) if request.propose else None
        return ImageResults(heightmap, shown, MappingProxyType(answers), proposal)

    def _depth_of(self, request: MeasureRequest) -> tuple[HeightMap, FrameResult]:
        reconstructor = self._reconstructor_for(request)
        if request.image is not self._image or self._depth is None:
            self._image = self._shown = None
            _require_sensor(request.image, request.calibration)
            image = request.image.image(request.calibration.response)
            heightmap = measurable_depth(reconstructor, image, name=request.image.name)
            self._depth = heightmap, np.clip(255.0 * image.rgb + 0.5, 0.0, 255.0).astype(np.uint8)
            self._image, self._answers = request.image, {}
        if self._shown is None or self._shown[0] != request.display:
            self._shown = request.display, _shown(*self._depth, request.display)
        return self._depth[0], self._shown[1]

    def _reconstructor_for(self, request: MeasureRequest) -> Reconstructor:
        """Return its own reconstructor. One of another thread must not be shared."""
        reconstructor = self._reconstructor
        if (
            reconstructor is None
            or reconstructor.calibration is not request.calibration
            or reconstructor.model != request.model
        ):
            self._reconstructor = Reconstructor(request.calibration, model=request.model)
            self._image = None
        assert self._reconstructor is not None
        return self._reconstructor


def _require_sensor(image: MeasuredImage, calibration: Calibration) -> None:
    serial = calibration.serial
    if image.serial not in ("", serial):
        raise InputError(
            (
                f"The image comes from sensor {image.serial}, "
                "but the calibration in use belongs to "
                f"sensor {serial}"
            ),
            image.name,
            Remedy.SAME_SENSOR,
        )


def _shown(
    heightmap: HeightMap, camera: NDArray[np.uint8], display: DisplaySettings
) -> FrameResult:
    """Return a measured image for all views."""
    depth = map_image(heightmap, display)
    scale = depth_scale(display.colours, depth.range_mm)
    return FrameResult(
        SourceFrame(camera, 0, 0.0),
        heightmap,
        heightmap,
        range_mm=depth.range_mm,
        colours=display.colours,
        camera=camera,
        height=depth.rgb,
        surface=surface_of(heightmap, depth.rgb, scale, range_mm=depth.range_mm, largest=NODES),
    )


def with_residual(shown: FrameResult, measurement: Measurement | None) -> FrameResult:
    """Return a measured image with a surface that shows the residual of the fitted object."""
    heightmap, surface = shown.heightmap, shown.surface
    if measurement is None or heightmap is None or surface is None:
        return shown
    residual = fit_residual(heightmap, measurement)
    valid_mask = np.isfinite(residual)
    scale = difference_scale(residual[valid_mask], "residual (mm)")
    coloured = shading.apply_colour_map(np.nan_to_num(residual), scale.table, scale.low, scale.high)
    texture = np.where(valid_mask[..., None], coloured, np.uint8(128))
    return replace(shown, surface=replace(surface, texture=texture, scale=scale))


def apply_tool(tool: Tool, heightmap: HeightMap) -> ToolOutcome:
    """Return the answer of a tool on a map."""
    try:
        return ToolOutcome(with_map_findings(tool.apply(heightmap), heightmap))
    except InputError as error:
        return ToolOutcome(refused=finding_from_error(error).line)
    except Exception as error:  # a tool that fails must not remove the figures of the others
        _LOG.exception("The tool %s failed", tool.name)
        return ToolOutcome(refused=error_message(error))
