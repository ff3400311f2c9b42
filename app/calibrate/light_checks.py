"""Parts of the live checks of the whiteboard and of the background."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from app.calibrate.detection import as_image, read_raw
from app.live.image_checks import Rgb
from app.live.overlay import Mask
from gelpolight_core.factors.bare_membrane import SHRINK
from gelpolight_core.session.images import require_colour
from gelpolight_core.translation import tr

Mask2 = NDArray[np.bool_]


class KnownImage:
    """Another stage's image, read when it is first needed, in the processing thread.

    Parameters
    ----------
    files : tuple of Path
        Images of that stage; the last one is used.
    """

    def __init__(self, files: tuple[Path, ...]) -> None:
        self._files = files
        self._rgb: Rgb | None = None

    @property
    def rgb(self) -> Rgb | None:
        """The image; None if there is none."""
        if self._rgb is None and self._files:
            self._rgb, self._files = read_raw(self._files[-1]), ()
        return self._rgb


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
