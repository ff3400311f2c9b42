"""The result of a detection in one frame, and error messages as sentences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.live.image_checks import Rgb, end_of_scale
from app.live.overlay import Overlay
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.finding import Finding, QualityTable, Verdict
from gelpolight_core.image.linear import LinearImage
from gelpolight_core.lights.mirror import MirrorSpots
from gelpolight_core.optics.checkerboard import BoardView
from gelpolight_core.reflectance.press import BallPress
from gelpolight_core.session.images import read_raw_image
from gelpolight_core.translation import tr

Found = BoardView | MirrorSpots | BallPress


@dataclass(frozen=True, slots=True)
class Detection:
    """What a stage detects in one frame.

    Attributes
    ----------
    overlay : Overlay
        Marks on the image.
    sentence : str
        What was found, or the problem and what to do.
    ready : bool
        Whether this frame may be captured for the stage.
    figures : tuple of Finding
        Judged figures for the table next to the image.
    found : BoardView, MirrorSpots, BallPress or None
        Result of the core's detector, used for example in the list of earlier views.
    warns : bool
        Whether the sentence is a warning although the frame may be captured.
    """

    overlay: Overlay
    sentence: str
    ready: bool
    figures: tuple[Finding, ...] = ()
    found: Found | None = None
    warns: bool = False

    @property
    def good(self) -> bool:
        """Whether the frame may be captured, and there is nothing to read first."""
        return self.ready and not self.warns


Detector = Callable[[NDArray[Any]], Detection]
NOTHING = Detection(Overlay(), "", True)


def too_early(_rgb: Rgb) -> Detection:
    """Detect nothing, because the results of earlier steps are missing."""
    return replace(NOTHING, sentence=tr("Complete the earlier steps first."), ready=False)


def read_raw(path: Path) -> Rgb:
    """Return an image file unchanged, (rows, columns, 3) uint8 or uint16 RGB.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    return np.ascontiguousarray(read_raw_image(path)[0])


def refuse_size(rgb: Rgb, size: tuple[int, int]) -> None:
    """Raise InputError if the frame does not have the (width, height) of earlier images."""
    if (rgb.shape[1], rgb.shape[0]) != size:
        raise InputError(
            tr("the image has {a} x {b} pixels, but the earlier stages used {c} x {d}").format(
                a=rgb.shape[1], b=rgb.shape[0], c=size[0], d=size[1]
            ),
            where=tr("Image"),
            advice=Remedy.SAME_CAMERA,
        )


def as_image(rgb: Rgb, name: str = "") -> LinearImage:
    """Return a frame (rows, columns, 3) as a core LinearImage: float32, 0..1."""
    values = rgb.astype(np.float32) / np.float32(end_of_scale(rgb))
    return LinearImage(name, values, bit_depth=8 * rgb.dtype.itemsize)


def sentence_of(refusal: InputError) -> str:
    """Return an error as a sentence without its `where` part: the image is on the screen."""
    return f"{refusal.found[:1].upper()}{refusal.found[1:]}. {refusal.advice}."


def or_refusal(detect: Callable[[], Detection], *, marks: Overlay | None = None) -> Detection:
    """Return the result of `detect`; if it raises InputError, its sentence with the given marks."""
    try:
        return detect()
    except InputError as refusal:
        return Detection(marks or Overlay(), sentence_of(refusal), False)


def judged(
    overlay: Overlay, figures: tuple[Finding, ...], good: str, found: Found | None = None
) -> Detection:
    """Return a detection that is ready unless a figure fails; its text is the worst figure's."""
    table = QualityTable(figures)
    bad = [f for f in figures if f.verdict is not Verdict.PASS and f.remedy]
    worst = next((f for f in bad if f.verdict is Verdict.FAIL), bad[0] if bad else None)
    text = good if worst is None else f"{worst.stated}. {worst.remedy}."
    ready = table.verdict is not Verdict.FAIL
    return Detection(overlay, text, ready, figures, found, warns=worst is not None)


def share(mask: NDArray[np.bool_], area: NDArray[np.bool_]) -> float:
    """Return the share of `area` that is in `mask`; 0 for an empty area."""
    count = int(np.count_nonzero(area))
    return float(np.count_nonzero(mask & area) / count) if count else 0.0
