"""The step of the ball presses on a closed sensor, with the benefit of one more press."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from app.calibrate.balls import BallsStep, Point, press_marks
from app.calibrate.detection import (
    Detection,
    Detector,
    or_refusal,
    read_raw,
    refuse_size,
    too_early,
)
from app.calibrate.states import is_done
from app.calibrate.step_data import step_of
from app.live.image_checks import Rgb
from app.live.overlay import Circle, Marker, Overlay
from gelpolight_core.calibration.in_place import BALLS, SCALE
from gelpolight_core.calibration.in_place_session import (
    ENOUGH_BALLS,
    SETTLED,
    Slopes,
    expected_gain,
    stated_grid,
)
from gelpolight_core.calibration.status import StageState
from gelpolight_core.finding import Finding, QualityTable, refused
from gelpolight_core.image.linear import linear_image
from gelpolight_core.image.response import CameraResponse
from gelpolight_core.in_place.calibrate import LEAST_PRESSES, contact_in
from gelpolight_core.reconstruction.in_place.change import Reference, reference
from gelpolight_core.reconstruction.in_place.grid import WorkingGrid
from gelpolight_core.session.session import InPlace
from gelpolight_core.translation import tr


@dataclass(frozen=True)
class Untouched:
    """The background, read and prepared when it is first needed, in the processing thread.

    Attributes
    ----------
    path : Path
        Its file.
    stated : InPlace
        Scale of the images, and the region of the membrane in them.
    response : CameraResponse or None
        Response of the camera.
    """

    path: Path
    stated: InPlace
    response: CameraResponse | None

    @cached_property
    def grid(self) -> WorkingGrid:
        """The grid on which images are compared."""
        rows, columns = self._image.shape[:2]
        return stated_grid(self.stated, (columns, rows))

    @cached_property
    def base(self) -> Reference:
        """The background on the grid, with its printed markers."""
        return reference(
            self.grid.reduce(linear_image(self._image, "", response=self.response).rgb)
        )

    @cached_property
    def _image(self) -> Rgb:
        return read_raw(self.path)


def detect_ball_in_place(
    rgb: Rgb,
    untouched: Untouched,
    *,
    radius_mm: float,
    marks: tuple[Marker, ...] = (),
    editable: bool = False,
) -> Detection:
    """Find a pressed ball.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    untouched : Untouched
        The background.
    radius_mm : float
        Radius of the ball.
    marks : tuple of Marker, optional
        Of earlier presses, and where the next one helps most.
    editable : bool, optional
        Whether the contact circle can be dragged; its handle is ball.
    """

    def detect() -> Detection:
        grid = untouched.grid
        refuse_size(rgb, (grid.image.width, grid.image.height))
        seen = grid.reduce(linear_image(rgb, "", response=untouched.response).rgb)
        radius = radius_mm / grid.pitch_mm
        found = contact_in(seen, untouched.base, radius=radius, name=tr("Image")).circle
        seen_at = grid.in_image(found)
        handle = "ball" if editable else ""
        contact = Circle(seen_at.x, seen_at.y, seen_at.radius, "good", handle)
        text = tr("Ball found: contact radius {c:.2f} mm.")
        return Detection(
            Overlay(markers=marks, circles=(contact,)),
            Finding("found", text.format(c=found.radius * grid.pitch_mm)),
        )

    return or_refusal(detect, marks=Overlay(markers=marks))


@dataclass(frozen=True, slots=True)
class Progress:
    """Accuracy of an in-place calibration, and whether more presses help.

    Attributes
    ----------
    error_deg : float
        Mean error of the normals of presses that were left out.
    gain : float or None
        Relative decrease of the error by one more press; None with too few presses.
    next_mm : (x, y) or None
        Where the next press helps most; None if more presses do not help.
    """

    error_deg: float
    gain: float | None
    next_mm: Point | None

    @property
    def settled(self) -> bool:
        """Whether more presses do not help."""
        return self.gain is not None and self.gain < SETTLED

    def sentence(self) -> str:
        """Return what one more press changes."""
        if self.gain is None:
            return tr("The next press helps most at the ring.")
        if self.settled:
            return tr("More presses do not help.")
        more = tr("One more lowers the error by about {g:.0f} %, most at the ring.")
        return more.format(g=100.0 * self.gain)


def progress_of(run: Slopes) -> Progress:
    """Return the progress of an in-place calibration."""
    result, gain = run.result, expected_gain(run.result)
    errors = [press.held_out.normal_deg for press in result.presses]
    settled = gain is not None and gain < SETTLED
    return Progress(
        float(np.mean(errors)),
        gain,
        None if settled else result.next_position_mm,
    )


ASKED = ("next_ball_gain_percent", "balls_used")
"""Figures whose advice is in the sentence about the next press."""


class InPlaceBallsStep(BallsStep):
    """Asks for presses until more do not help."""

    step = step_of(
        BALLS,
        tr("Press the ball where the ring is, and hold it still."),
        "ball",
        frames=4,
        wanted=ENOUGH_BALLS,
        least=LEAST_PRESSES,
        advice=tr("Its slopes must be as steep as what you want to measure."),
    )

    def detector(self, name: str) -> Detector:
        """Return the detection of a pressed ball beside the background."""
        session = self.model.project.session
        files = session.found("background")
        if not files:
            return too_early
        run, stated = self._run(), session.in_place or InPlace()
        if stated.mm_per_px is None:
            scale = self.model.project.results.get(SCALE)
            if scale is None:
                return too_early
            stated = replace(stated, mm_per_px=scale.mm_per_px)
        detect = partial(
            detect_ball_in_place,
            untouched=Untouched(files[-1], stated, session.response),
            radius_mm=self.radius.radius_mm,
        )
        if name:
            return self.of_capture(name, partial(detect, editable=True), Overlay())
        if run is None:
            return detect
        pixels, next_mm = run.result.model.grid.to_pixels, progress_of(run).next_mm
        earlier = pixels(np.array([(x, y) for _name, x, y, *_ in run.balls]))
        there = () if next_mm is None else pixels(np.array([next_mm]))
        return partial(detect, marks=press_marks(earlier, there))

    def _run(self) -> Slopes | None:
        """Return the calibration of the present presses."""
        state = self.model.statuses["balls"].state
        stale = state in (StageState.EMPTY, StageState.WAITING, StageState.FAIL)
        return None if stale else self.model.project.results.get(BALLS)

    @property
    def progress(self) -> Progress | None:
        """Accuracy from the present presses; None without an up-to-date calibration."""
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
            return refused(fault)
        for press in run.result.presses:
            if press.name == path.name:
                error = press.held_out.normal_deg
                return Finding("normal_error_deg", tr("Normal error"), error, "deg")
        return None

    def is_finished(self, state: str) -> bool:
        """Return whether more presses do not help."""
        progress = self.progress
        return is_done(state) and progress is not None and progress.settled

    def number(self) -> Finding | None:
        """Return the expected error of the normals."""
        progress = self.progress
        if progress is None:
            return None
        return Finding(
            "normal_error_deg", tr("Expected error of the normals"), progress.error_deg, "deg"
        )

    def progress_line(self) -> str:
        """Return how many presses there are, and what one more changes."""
        progress = self.progress
        if progress is None:
            return super().progress_line()
        return tr("{n} captured.").format(n=self.count()) + " " + progress.sentence()

    def show_state(self, state: str, sentence: str) -> None:
        """Show the state; the effect of one more press is shown beside the number."""
        if self.progress is not None:
            figures = self.model.statuses["balls"].quality.figures
            others = QualityTable(tuple(f for f in figures if f.key not in ASKED)).remedies
            sentence = " ".join(f"{advice}." for advice in others)
        super().show_state(state, sentence)

    def depends_on(self) -> tuple[Any, ...]:
        """Return the radius, the scale and the background."""
        session = self.model.project.session
        return (*super().depends_on(), session.in_place, session.found("background"))
