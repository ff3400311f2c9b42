"""What a stage sees in one frame, and how refusals become sentences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.live.overlay import Note, Overlay, Role
from app.live.picture_checks import Rgb, end_of_scale
from gelpolight_core.errors import InputError
from gelpolight_core.lights.mirror import MirrorSpots
from gelpolight_core.optics.checkerboard import BoardView
from gelpolight_core.quality import Figure, QualityTable, Verdict
from gelpolight_core.reflectance.press import BallPress
from gelpolight_core.session.picture import Picture

Found = BoardView | MirrorSpots | BallPress


@dataclass(frozen=True, slots=True)
class Detection:
    """What a stage sees in one frame.

    Attributes
    ----------
    overlay : Overlay
        Marks on the picture.
    sentence : str
        What was found, or why not and what to do.
    ready : bool
        Whether this frame may be captured for the stage.
    figures : tuple of Figure
        Judged numbers for a table beside the picture.
    found : BoardView, MirrorSpots, BallPress or None
        The core's own result, such as for the list of earlier views.
    warns : bool
        Whether the sentence is advice, although the frame may be captured.
    """

    overlay: Overlay
    sentence: str
    ready: bool
    figures: tuple[Figure, ...] = ()
    found: Found | None = None
    warns: bool = False


def as_picture(rgb: Rgb, name: str = "") -> Picture:
    """Return a frame (rows, columns, 3) as the core's picture: float32, 0..1."""
    values = rgb.astype(np.float32) / np.float32(end_of_scale(rgb))
    return Picture(name, values, bit_depth=8 * rgb.dtype.itemsize)


def sentence_of(refusal: InputError) -> str:
    """Return a refusal without the place: the picture it speaks of is on the screen."""
    return f"{refusal.found[:1].upper()}{refusal.found[1:]}. {refusal.advice}."


def or_refusal(look: Callable[[], Detection], *, marks: Overlay | None = None) -> Detection:
    """Return what `look` returns; of what it refuses, the sentence, over the marks given."""
    try:
        return look()
    except InputError as refusal:
        return Detection(marks or Overlay(), sentence_of(refusal), False)


def judged(
    overlay: Overlay, figures: tuple[Figure, ...], good: str, found: Found | None = None
) -> Detection:
    """Return a detection that is ready unless a figure fails; the worst figure has the word."""
    table = QualityTable(figures)
    bad = [f for f in figures if f.verdict is not Verdict.PASS and f.advice]
    worst = next((f for f in bad if f.verdict is Verdict.FAIL), bad[0] if bad else None)
    text = good if worst is None else f"{figure_text(worst)}. {worst.advice}."
    ready = table.verdict is not Verdict.FAIL
    return Detection(overlay, text, ready, figures, found, warns=worst is not None)


def figure_text(figure: Figure) -> str:
    """Return a figure as words: label, value and unit."""
    return f"{figure.label}: {figure.value:.3g} {figure.unit}".rstrip()


def with_note(detection: Detection) -> Overlay:
    """Return a detection's overlay with its sentence in the corner, for a view without a page."""
    role: Role = "good" if detection.ready else "bad"
    marks = detection.overlay
    note = Note(detection.sentence, role)
    return Overlay(marks.markers, marks.circles, marks.lines, marks.masks, (*marks.notes, note))


def share(mask: NDArray[np.bool_], area: NDArray[np.bool_]) -> float:
    """Return which share of `area` is in `mask`; 0 for an empty area."""
    count = int(np.count_nonzero(area))
    return float(np.count_nonzero(mask & area) / count) if count else 0.0
