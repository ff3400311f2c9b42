"""The steps of a closed sensor: the scale of its images, and presses of a ball."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from app.live.overlay import ImageOverlay, OverlayCircle, OverlayMarker
from gelpolight_core.base.arrays import Float32Array, PixelArray, PointXY
from gelpolight_core.base.finding import Finding, QualityTable, Verdict, finding_from_error
from gelpolight_core.calibration.closed_sensor.pixel_scale import find_pins, find_punch
from gelpolight_core.calibration.closed_sensor.press_sizes import PressSize
from gelpolight_core.calibration.closed_sensor.slope_calibration import LEAST_PRESSES, contact_in
from gelpolight_core.calibration.closed_sensor_recipe import BALLS, SCALE
from gelpolight_core.calibration.closed_sensor_stages import (
    ENOUGH_BALLS,
    SETTLED,
    SlopesStageResult,
    expected_error_reduction,
    stated_grid,
)
from gelpolight_core.calibration.stage_status import StageState
from gelpolight_core.image.linear_image import linear_image
from gelpolight_core.image.response import CameraResponse
from gelpolight_core.sensor.closed_sensor.colour_change import ReferenceImage, make_reference_image
from gelpolight_core.sensor.closed_sensor.working_grid import WorkingGrid
from gelpolight_core.session.session import ClosedSensorSettings

from .ball_steps import BallsStep, press_marks
from .detection_marks import (
    Detection,
    Detector,
    detect_nothing,
    detect_or_refusal,
    read_raw,
    refuse_grey,
    refuse_size,
)
from .image_step import ImageStep
from .page_state import is_done


@dataclass(frozen=True)
class LazyBackground:
    """The background, read and prepared when it is first needed, in the processing thread.

    Attributes
    ----------
    path : Path
        File of the background image.
    declared : ClosedSensorSettings
        Scale of the images or size of the pressed object, and the region of the membrane.
    response : CameraResponse or None
        Response of the camera.
    """

    path: Path
    declared: ClosedSensorSettings
    response: CameraResponse | None

    @cached_property
    def grid(self) -> WorkingGrid:
        """The grid on which images are compared."""
        rows, columns = self._image.shape[:2]
        return stated_grid(self.declared, (columns, rows))

    @cached_property
    def base(self) -> ReferenceImage:
        """The background on the grid, with its printed markers."""
        return make_reference_image(self.grid.reduce(self.linear))

    @cached_property
    def linear(self) -> Float32Array:
        """The background as linear light."""
        return linear_image(self._image, "", response=self.response).rgb

    @cached_property
    def _image(self) -> PixelArray:
        return read_raw(self.path)

    def linear_frame(self, rgb: PixelArray) -> Float32Array:
        """Return a frame as linear light, or raise InputError if it has another size."""
        refuse_size(rgb, (self.grid.image.width, self.grid.image.height))
        return linear_image(rgb, "", response=self.response).rgb


def detect_scale(rgb: PixelArray, untouched: LazyBackground) -> Detection:
    """Find the pressed object of known size, and show the size of a pixel that follows.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    untouched : LazyBackground
        The background.
    """

    def detect() -> Detection:
        refuse_grey(rgb)
        images = untouched.linear_frame(rgb), untouched.linear
        grid, pressed = untouched.grid, untouched.declared.pressed_scale
        if pressed.pin_spacing_mm is not None:
            pins = find_pins(*images, grid=grid, where="Image")
            pins_px = pins.pins_px
            dots = tuple(OverlayMarker(u, v, "dot", "good") for u, v in pins_px)
            marks = ImageOverlay(markers=dots)
            x, y = pressed.pin_spacing_mm / pins.spacing_px
            text = f"{len(pins_px)} pins found: a pixel is {x:.4f} mm wide and {y:.4f} mm high."
        else:
            disc = find_punch(*images, grid=grid, where="Image")
            marks = ImageOverlay(circles=(OverlayCircle(disc.x, disc.y, disc.radius, "good"),))
            mm_per_px = (pressed.punch_diameter_mm or 0.0) / (2.0 * disc.radius)
            text = f"Contact of the punch found: a pixel is {mm_per_px:.4f} mm wide."
        return Detection(marks, Finding("found", text))

    return detect_or_refusal(detect)


class ScaleStep(ImageStep):
    """Measures the size of a pixel on images of a pressed pin grid or flat punch."""

    of = SCALE
    guide = "guide/closed-sensors", "scale"
    task = "Press the pin grid or the flat punch straight in, at a new place for each image."
    assembly = "indenter"
    frames, wanted = 4, 3
    advice = "The size of a pixel is measured on it. Its own size is stated in the set-up."

    def detector(self, name: str) -> Detector:
        """Return the detection of the pressed object beside the background."""
        session = self.session
        files = session.found("background")
        if not files:
            return detect_nothing
        declared = session.in_place or ClosedSensorSettings()
        untouched = LazyBackground(files[-1], declared, session.response)
        return partial(detect_scale, untouched=untouched)

    def depends_on(self) -> tuple[Any, ...]:
        """Return the size of the pressed object, and the background."""
        session = self.session
        return session.in_place, session.found("background")


def detect_ball_in_place(
    rgb: PixelArray,
    untouched: LazyBackground,
    *,
    radius_mm: float,
    marks: tuple[OverlayMarker, ...] = (),
    editable: bool = False,
) -> Detection:
    """Find a pressed ball.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    untouched : LazyBackground
        The background.
    radius_mm : float
        Radius of the ball.
    marks : tuple of OverlayMarker, optional
        Marks at earlier presses, and where the next one helps most.
    editable : bool, optional
        Whether the contact circle can be dragged; its handle is ball.
    """

    def detect() -> Detection:
        grid = untouched.grid
        reduced = grid.reduce(untouched.linear_frame(rgb))
        radius_nodes = radius_mm / grid.pitch_mm
        circle = contact_in(reduced, untouched.base, radius=radius_nodes, name="Image").circle
        circle_px = grid.in_image(circle)
        handle = "ball" if editable else ""
        mark = OverlayCircle(circle_px.x, circle_px.y, circle_px.radius, "good", handle)
        text = f"Ball found: contact radius {circle.radius * grid.pitch_mm:.2f} mm."
        return Detection(ImageOverlay(markers=marks, circles=(mark,)), Finding("found", text))

    return detect_or_refusal(detect, marks=ImageOverlay(markers=marks))


@dataclass(frozen=True, slots=True)
class InPlaceProgress:
    """Accuracy of an in-place calibration, to decide on more presses.

    Attributes
    ----------
    error_deg : float
        Mean error of the normals of presses that were left out.
    gain : float or None
        Relative decrease of the error by one more press; None with too few presses.
    """

    error_deg: float
    gain: float | None

    @property
    def settled(self) -> bool:
        """Whether more presses do not help."""
        return self.gain is not None and self.gain < SETTLED

    def sentence(self) -> str:
        """Return what one more press changes."""
        if self.gain is None:
            return "The next press helps most at the ring."
        if self.settled:
            return "More presses do not help."
        return f"One more lowers the error by about {100.0 * self.gain:.0f} %, most at the ring."


def progress_of(run: SlopesStageResult) -> InPlaceProgress:
    """Return the progress of an in-place calibration."""
    errors = [press.held_out.normal_deg for press in run.result.presses]
    return InPlaceProgress(float(np.mean(errors)), expected_error_reduction(run.result))


ASKED = ("next_ball_gain_percent", "balls_used")
"""Figures whose advice is in the sentence about the next press."""


class InPlaceBallsStep(BallsStep):
    """Asks for presses until more do not help."""

    of = BALLS
    guide = "guide/closed-sensors", "ball-presses"
    frames, wanted, least = 4, ENOUGH_BALLS, LEAST_PRESSES
    advice = "Its slopes must be as steep as what you want to measure."

    def detector(self, name: str) -> Detector:
        """Return the detection of a pressed ball beside the background."""
        session = self.session
        files = session.found("background")
        if not files:
            return detect_nothing
        declared = session.in_place or ClosedSensorSettings()
        if declared.mm_per_px is None:
            scale = self.results.get(SCALE)
            if scale is None:
                return detect_nothing
            declared = replace(declared, mm_per_px=scale.mm_per_px)
        detect = partial(
            detect_ball_in_place,
            untouched=LazyBackground(files[-1], declared, session.response),
            radius_mm=self.radius_mm,
        )
        if name:
            return self.of_capture(name, partial(detect, editable=True), ImageOverlay())
        return partial(detect, marks=press_marks(*self.places_px()))

    def places_px(self) -> tuple[Iterable[PointXY], Iterable[PointXY]]:
        """Return where balls were pressed, and where the next press helps, until it does not."""
        slopes = self._run()
        if slopes is None:
            return (), ()
        to_pixels, next_mm = slopes.result.model.grid.to_pixels, slopes.result.next_position_mm
        earlier_px = to_pixels(np.array([(x, y) for _name, x, y, *_ in slopes.balls]))
        return earlier_px, () if progress_of(slopes).settled else to_pixels(np.array([next_mm]))

    def _run(self) -> SlopesStageResult | None:
        """Return the calibration of the present presses."""
        state = self.model.statuses["balls"].state
        stale = state in (StageState.EMPTY, StageState.WAITING, StageState.FAIL)
        return None if stale else self.results.get(BALLS)

    @property
    def progress(self) -> InPlaceProgress | None:
        """Accuracy from the present presses, or None without an up-to-date calibration."""
        run = self._run()
        present = self.model.statuses["balls"].state is not StageState.STALE
        return progress_of(run) if run is not None and present else None

    def judge(self, path: Path) -> Finding | None:
        """Return how well the other presses explain a press."""
        run = self._run()
        if run is None:
            return None
        fault = run.result.refused.get(path.name)
        if fault is not None:
            return finding_from_error(fault)
        remedy = next((size.remedy for size in self._wrong_sizes() if size.name == path.name), "")
        verdict = Verdict.WARN if remedy else Verdict.PASS
        for press in run.result.presses:
            if press.name == path.name:
                error = press.held_out.normal_deg
                finding = Finding("normal_error_deg", "Normal error", error, "deg")
                return replace(finding, verdict=verdict, remedy=remedy)
        return None

    def _wrong_sizes(self) -> list[PressSize]:
        """Return the presses whose present diameter contradicts the others."""
        run, radius_mm = self._run(), self.session.ball_radius_mm
        sizes = () if run is None else run.sizes
        return [s for s in sizes if s.remedy and 2.0 * radius_mm(s.name) == s.stated_mm]

    def fitting_diameters(self) -> Iterable[tuple[str, float]]:
        """Yield name and fitting diameter (mm) of each press that disagrees with the others."""
        return ((size.name, size.proposed_mm) for size in self._wrong_sizes())

    def is_finished(self, state: str) -> bool:
        """Return whether more presses do not help."""
        progress = self.progress
        return is_done(state) and progress is not None and progress.settled

    def number(self) -> Finding | None:
        """Return the expected error of the normals."""
        progress = self.progress
        if progress is None:
            return None
        text = "Expected error of the normals"
        return Finding("normal_error_deg", text, progress.error_deg, "deg")

    def progress_line(self) -> str:
        """Return the number of presses, and the effect of one more."""
        progress = self.progress
        if progress is None:
            return super().progress_line()
        return f"{self.count()} captured. {progress.sentence()}"

    def explain(self, state: str, sentence: str) -> str:
        """Return the message without the effect of one more press, which is beside the number."""
        if self.progress is None:
            return sentence
        figures = self.model.statuses["balls"].quality.figures
        remedies = QualityTable(tuple(f for f in figures if f.key not in ASKED)).remedies
        return " ".join(f"{advice}." for advice in remedies)

    def depends_on(self) -> tuple[Any, ...]:
        """Return the radius, the scale and the background."""
        session = self.session
        return (*super().depends_on(), session.in_place, session.found("background"))
