"""From a picture and what was drawn on it to figures; runs beside the window.

A picture is read and reconstructed as ``gelpolight measure`` does it, so that both say the same.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from app.inspect.look import Look
from app.measure.map_picture import MapPicture, map_picture
from app.measure.sheet import Sheet
from app.sources.source import Frame
from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.errors import InputError
from gelpolight_core.measurement.proposal import Proposal, propose
from gelpolight_core.measurement.tools import Tool, ToolResult
from gelpolight_core.reconstruction.heightmap import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.response.curve import CameraResponse
from gelpolight_core.session.picture import Picture
from gelpolight_core.session.session import read_picture, require_colour
from gelpolight_core.translation import tr

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class Taken:
    """A picture that is measured on.

    Attributes
    ----------
    name : str
        What people call it.
    path : Path or None
        Its file; None for one that the camera gave.
    frame : Frame or None
        What the camera gave; None for a file.
    serial : str
        Of the sensor that it is known to be of; empty where that is not known.
    """

    name: str
    path: Path | None = None
    frame: Frame | None = None
    serial: str = ""

    def picture(self, response: CameraResponse | None) -> Picture:
        """Return it as linear light.

        Raises
        ------
        InputError
            If the file cannot be used, or the picture is grey.
        """
        if self.path is not None:
            picture = read_picture(self.path, response=response)
        else:
            assert self.frame is not None
            picture = Picture(self.name, _linear(self.frame.rgb, response))
        require_colour(picture, where=self.name)
        return picture


def _linear(
    rgb: NDArray[np.uint8] | NDArray[np.uint16], response: CameraResponse | None
) -> NDArray[np.float32]:
    """Return a frame as linear light, by the very operations that a file goes through."""
    if response is not None:
        return response.linearise(rgb)
    return np.asarray(rgb, np.float32) / np.float32(np.iinfo(rgb.dtype).max)


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """What is to be measured.

    Attributes
    ----------
    calibration : Calibration
        Of the sensor.
    model : str
        The calibration's, or ``paper``.
    taken : Taken
        The picture.
    sheet : Sheet
        The tools on it.
    propose : bool
        Whether it is to be said what is pressed.
    """

    calibration: Calibration
    model: str
    taken: Taken
    sheet: Sheet
    propose: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """What came of it.

    Attributes
    ----------
    heightmap : HeightMap
        Of the picture, with its uncertainty.
    picture : MapPicture
        How it is shown.
    linear : (rows, columns, 3) float32
        The camera's picture, linear light.
    results : mapping of int to ToolResult or str
        By the tools' keys; a sentence where a tool could not be applied.
    proposal : Proposal or None
        What is pressed, where that was asked and can be said.
    """

    heightmap: HeightMap
    picture: MapPicture
    linear: NDArray[np.float32]
    results: Mapping[int, ToolResult | str] = field(default_factory=lambda: MappingProxyType({}))
    proposal: Proposal | None = None


class Measuring:
    """Answers questions; keeps what does not change from one to the next.

    A function for one thread at a time. None in the place of a question: forget all that is kept.
    """

    def __init__(self) -> None:
        self._forget()

    def _forget(self) -> None:
        self._reconstructor: Reconstructor | None = None
        self._taken: Taken | None = None
        self._shown: tuple[HeightMap, MapPicture, NDArray[np.float32]] | None = None
        self._results: dict[Tool, ToolResult | str] = {}

    def __call__(self, question: Question | None) -> Answer | None:
        """Measure.

        Raises
        ------
        InputError
            If the picture cannot be used, or is not of the calibration's sensor or size.
        """
        if question is None:
            self._forget()
            return None
        heightmap, picture, linear = self._depth_of(question)
        results = {}
        for item in question.sheet.items:
            if item.tool not in self._results:
                self._results[item.tool] = apply_tool(item.tool, heightmap)
            results[item.key] = self._results[item.tool]
        proposal = propose(heightmap) if question.propose else None
        return Answer(heightmap, picture, linear, MappingProxyType(results), proposal)

    def _depth_of(self, question: Question) -> tuple[HeightMap, MapPicture, NDArray[np.float32]]:
        reconstructor = self._reconstructor_for(question)
        if question.taken is not self._taken or self._shown is None:
            self._taken = None
            _require_sensor(question.taken, question.calibration)
            picture = question.taken.picture(question.calibration.response)
            heightmap = reconstructor.depth(
                picture.rgb, name=question.taken.name, normals=False, uncertainty=True
            )
            self._shown = heightmap, map_picture(heightmap, Look()), picture.rgb
            self._taken, self._results = question.taken, {}
        return self._shown

    def _reconstructor_for(self, question: Question) -> Reconstructor:
        """Return one of its own: another thread's must not be used at the same time."""
        known = self._reconstructor
        if (
            known is None
            or known.calibration is not question.calibration
            or known.model != question.model
        ):
            self._reconstructor = Reconstructor(question.calibration, model=question.model)
            self._taken = None
        assert self._reconstructor is not None
        return self._reconstructor


def _require_sensor(taken: Taken, calibration: Calibration) -> None:
    serial = calibration.sensor.serial
    if taken.serial not in ("", serial):
        raise InputError(
            tr("the picture is of {other}, the calibration in use is of {one}").format(
                other=taken.serial, one=serial
            ),
            where=taken.name,
            advice=tr("Choose a calibration of that sensor"),
        )


def apply_tool(tool: Tool, heightmap: HeightMap) -> ToolResult | str:
    """Return what a tool says of a map, or why it says nothing."""
    try:
        return tool.apply(heightmap)
    except InputError as error:
        return str(error)
    except Exception as error:  # one tool that fails must not take the others' figures away
        _LOG.exception("The tool %s failed", tool.name)
        return tr("A fault of this program: {kind}; the log has it.").format(
            kind=type(error).__name__
        )
