"""Detections of the stages: from figures, from errors, and of images that come too early."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from app.live.image_checks import Rgb, end_of_scale
from app.live.live_detection import Detection as Detection
from app.live.overlay import Mask, Overlay
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.factors.bare_membrane import SHRINK
from gelpolight_core.finding import Finding, Verdict, refused, worst_of
from gelpolight_core.image.linear import LinearImage
from gelpolight_core.session.images import read_raw_image, require_colour
from gelpolight_core.translation import tr

Detector = Callable[[NDArray[Any]], Detection]
Mask2 = NDArray[np.bool_]


def too_early(_rgb: Rgb) -> Detection:
    """Detect nothing, because the results of earlier steps are missing."""
    text = tr("Complete the earlier steps first.")
    return Detection(Overlay(), Finding("too_early", text, verdict=Verdict.FAIL))


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


def or_refusal(detect: Callable[[], Detection], *, marks: Overlay | None = None) -> Detection:
    """Return the result of `detect`; if it raises InputError, its finding with the given marks."""
    try:
        return detect()
    except InputError as error:
        return Detection(marks or Overlay(), refused(error))


def judged(overlay: Overlay, figures: tuple[Finding, ...], good: str) -> Detection:
    """Return a detection with its worst figure, or with the text `good` if all of them pass."""
    worst = worst_of(figures)
    return Detection(overlay, Finding("found", good) if worst is None else worst)


def share(mask: NDArray[np.bool_], area: NDArray[np.bool_]) -> float:
    """Return the share of `area` that is in `mask`; 0 for an empty area."""
    count = int(np.count_nonzero(area))
    return float(np.count_nonzero(mask & area) / count) if count else 0.0


def beside(files: tuple[Path, ...], detect: Callable[[Rgb, Rgb | None], Detection]) -> Detector:
    """Return a detection that also gets the last image of another stage; None without one.

    That image is read once, when it is first needed, in the processing thread.
    """

    @cache
    def other() -> Rgb | None:
        return read_raw(files[-1]) if files else None

    return lambda rgb: or_refusal(lambda: detect(rgb, other()))


def refuse_grey(rgb: Rgb) -> None:
    """Raise InputError if the image has no colours."""
    require_colour(as_image(rgb[::SHRINK, ::SHRINK]), where=tr("Image"))


def enlarged(mask: Mask2, rgb: Rgb) -> Mask2:
    """Return a mask of the shrunk image at the size of the image."""
    size = (rgb.shape[1], rgb.shape[0])
    return np.asarray(cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)) > 0


def marked(full: Mask2, suspect: Mask2) -> tuple[Mask, ...]:
    """Return the masks of saturated and suspect pixels that are not empty."""
    both = (Mask(full, "bad"), Mask(suspect, "expected"))
    return tuple(mask for mask in both if mask.area.any())
