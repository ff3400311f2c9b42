"""From an image and the tools on it to figures. Runs in the background.

An image is read and reconstructed as ``gelpolight measure`` does it, so that both give the same
results.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from app.sources.source import Frame
from app.view2d.display import Display
from app.view2d.shading import MapImage, map_image
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.image.linear import LinearImage, linear_image
from gelpolight_core.image.response import CameraResponse
from gelpolight_core.measurement.measurable import measurable_depth
from gelpolight_core.measurement.proposal import Proposal, propose
from gelpolight_core.measurement.tools import Tool, ToolResult
from gelpolight_core.measurement.trust import judged
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.images import read_image, require_colour
from gelpolight_core.translation import tr

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredImage:
    """An image to measure on.

    Attributes
    ----------
    name : str
        Name shown to the user.
    path : Path or None
        Its file. None for a camera image.
    frame : Frame or None
        The frame of the camera. None for a file.
    serial : str
        Serial of its sensor. Empty if unknown.
    """

    name: str
    path: Path | None = None
    frame: Frame | None = None
    serial: str = ""

    def image(self, response: CameraResponse | None) -> LinearImage:
        """Return it as linear light.

        Raises
        ------
        InputError
            If the file cannot be used, or the image is greyscale.
        """
        if self.path is not None:
            image = read_image(self.path, response=response)
        else:
            assert self.frame is not None
            image = linear_image(self.frame.rgb, self.name, response=response)
        require_colour(image, where=self.name)
        return image


@dataclass(frozen=True, slots=True, eq=False)
class MeasureRequest:
    """What to measure.

    Attributes
    ----------
    calibration : Calibration
        Of the sensor.
    model : str
        The calibration's, or ``paper``.
    image : MeasuredImage
        The image.
    sheet : mapping of int to Tool
        The tools on it by their keys.
    propose : bool
        Whether to detect the object.
    """

    calibration: Calibration
    model: str
    image: MeasuredImage
    sheet: Mapping[int, Tool]
    propose: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class ImageResults:
    """The results.

    Attributes
    ----------
    heightmap : HeightMap
        Of the image, with its uncertainty.
    map_image : MapImage
        How it is shown.
    linear : (rows, columns, 3) float32
        The camera image, linear light.
    results : mapping of int to ToolResult or str
        By the tools' keys. A sentence if a tool could not be applied.
    proposal : Proposal or None
        The detected object, if requested and found.
    """

    heightmap: HeightMap
    map_image: MapImage
    linear: NDArray[np.float32]
    results: Mapping[int, ToolResult | str] = field(default_factory=lambda: MappingProxyType({}))
    proposal: Proposal | None = None


class Measuring:
    """Answers requests, and keeps what does not change between them.

    Used by one thread at a time. None instead of a request clears all kept data.
    """

    def __init__(self) -> None:
        self._forget()

    def _forget(self) -> None:
        self._reconstructor: Reconstructor | None = None
        self._image: MeasuredImage | None = None
        self._shown: tuple[HeightMap, MapImage, NDArray[np.float32]] | None = None
        self._results: dict[Tool, ToolResult | str] = {}

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
        heightmap, shown, linear = self._depth_of(request)
        results = {}
        for key, tool in request.sheet.items():
            if tool not in self._results:
                self._results[tool] = apply_tool(tool, heightmap)
            results[key] = self._results[tool]
        proposal = propose(heightmap) if request.propose else None
        return ImageResults(heightmap, shown, linear, MappingProxyType(results), proposal)

    def _depth_of(self, request: MeasureRequest) -> tuple[HeightMap, MapImage, NDArray[np.float32]]:
        reconstructor = self._reconstructor_for(request)
        if request.image is not self._image or self._shown is None:
            self._image = None
            _require_sensor(request.image, request.calibration)
            image = request.image.image(request.calibration.response)
            heightmap = measurable_depth(reconstructor, image.rgb, name=request.image.name)
            self._shown = heightmap, map_image(heightmap, Display()), image.rgb
            self._image, self._results = request.image, {}
        return self._shown

    def _reconstructor_for(self, request: MeasureRequest) -> Reconstructor:
        """Return its own reconstructor, because that of another thread must not be shared."""
        known = self._reconstructor
        if (
            known is None
            or known.calibration is not request.calibration
            or known.model != request.model
        ):
            self._reconstructor = Reconstructor(request.calibration, model=request.model)
            self._image = None
        assert self._reconstructor is not None
        return self._reconstructor


def _require_sensor(image: MeasuredImage, calibration: Calibration) -> None:
    serial = calibration.serial
    if image.serial not in ("", serial):
        raise InputError(
            tr(
                "The image comes from sensor {other}, but the calibration in use belongs to "
                "sensor {one}"
            ).format(other=image.serial, one=serial),
            where=image.name,
            advice=Remedy.SAME_SENSOR,
        )


def apply_tool(tool: Tool, heightmap: HeightMap) -> ToolResult | str:
    """Return the result of a tool on a map, or why there is none."""
    try:
        return judged(tool.apply(heightmap), heightmap)
    except InputError as error:
        return str(error)
    except Exception as error:  # a tool that fails must not remove the figures of the others
        _LOG.exception("The tool %s failed", tool.name)
        return tr("Internal error: {kind}. See the log for details.").format(
            kind=type(error).__name__
        )
