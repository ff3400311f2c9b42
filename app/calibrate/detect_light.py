"""What whiteboard and background stage see in a frame: whether it is lit, even and untouched.

In the raw picture, at a quarter of its size, with the core's own limits; a speck, a saturated patch
and a press are shown where they are.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from app.calibrate.detection import Detection, as_picture, judged, or_refusal, share
from app.calibrate.marks import working_area, working_rim
from app.live.overlay import Mask, Overlay
from app.live.picture_checks import Rgb, end_of_scale, saturated
from gelpolight_core.errors import InputError
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.quality import Figure, judge
from gelpolight_core.radiance.whiteboard import LEAST_LIGHT
from gelpolight_core.session.session import require_colour
from gelpolight_core.translation import tr

Float = NDArray[np.float32]
Mask2 = NDArray[np.bool_]

SHRINK = 4
# Specks and squares change brightness within a fiftieth of the picture, light does not.
SPECK_OF_WIDTH = 0.02
# Half of what shading at the edge of a shallow contact changes, twice what noise leaves.
SPECK_CHANGE = 0.10
# A contact is a few hundredths of the picture across, and its shading broader than specks.
CONTACT_OF_WIDTH = 0.04
# An area of this share of the picture's width squared is larger than any speck of the membrane.
PRESSED_OF_WIDTH = 0.015
# Two pictures of one thing differ by this share or less, by noise and a flickering light.
SAME_PICTURE = 0.02
# Below eight steps of eight bits a ratio is mostly rounding.
LEAST_RATIO_LIGHT = 8.0 / 255.0


def detect_whiteboard(
    rgb: Rgb, *, table: ResamplingTable | None = None, background: Rgb | None = None
) -> Detection:
    """Judge the light on the whiteboard.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    table : ResamplingTable, optional
        Says where the working area is; without it the whole picture counts.
    background : (rows, columns, 3), optional
        The background stage's picture, where there is one already: the membrane is told by it.
    """
    rim = Overlay(lines=() if table is None else (working_rim(table),))

    def look() -> Detection:
        area, small = _prepare(rgb, table)
        if background is not None and background.shape == rgb.shape:
            _refuse_membrane(small, _small(background), area)
        unlit = area & (small.min(axis=2) < LEAST_LIGHT)
        lit = area & ~unlit
        inner = _without_rim(lit)
        change = _local_change(small, inner, SPECK_OF_WIDTH * small.shape[1])
        specks = inner & (change > SPECK_CHANGE)
        full = saturated(rgb) > 0
        marks = Overlay(
            lines=rim.lines,
            masks=_masks(full, _enlarge(specks, rgb)),
        )
        figures = (
            *_brightness_figures(small, area),
            _saturated_figure(full, area, warn=0.1, fail=10.0),
            judge("unlit", tr("Unlit share"), 100.0 * share(unlit, area), "%", warn=10.0, fail=40.0,
                  advice=tr("Press the board flat onto the surface; expose longer")),
            judge("specks", tr("Specks and edges"), 100.0 * share(specks, area), "%",
                  warn=3.0, fail=20.0,
                  advice=tr("Use an even white board; clean it and the elastomer")),
            judge("light_range", tr("Brightest over darkest place"), _light_range(small, lit),
                  warn=40.0, advice=tr("Lower or move the LEDs for a more even light")),
        )  # fmt: skip
        return judged(marks, figures, tr("The whiteboard is lit well."))

    return or_refusal(look, marks=rim)


def detect_background(
    rgb: Rgb, *, table: ResamplingTable | None = None, whiteboard: Rgb | None = None
) -> Detection:
    """Judge the bare membrane: lit, not saturated, nothing pressed.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    table : ResamplingTable, optional
        As for :func:`detect_whiteboard`.
    whiteboard : (rows, columns, 3), optional
        The whiteboard stage's picture; against it a press stands out. Without it, nothing is said
        about presses.
    """
    rim = Overlay(lines=() if table is None else (working_rim(table),))

    def look() -> Detection:
        area, small = _prepare(rgb, table)
        full = saturated(rgb) > 0
        pressed = np.zeros(area.shape, np.bool_)
        good = tr(
            "The membrane is lit well. Whether anything touches it is told once the whiteboard is"
            " captured."
        )
        if whiteboard is not None and whiteboard.shape == rgb.shape:
            white = _small(whiteboard)
            _refuse_whiteboard(small, white, area)
            pressed = _find_pressed(small, white, area)
            good = tr("The membrane is lit well and nothing touches it.")
        marks = Overlay(
            lines=rim.lines,
            masks=_masks(full, _enlarge(pressed, rgb)),
        )
        figures = (
            *_brightness_figures(small, area),
            _saturated_figure(full, area, warn=1.0, fail=20.0),
            judge("pressed", tr("Area that looks pressed in"), 100.0 * share(pressed, area), "%",
                  fail=0.0, advice=tr("Lift off whatever touches the membrane, and wipe it clean")),
        )  # fmt: skip
        return judged(marks, figures, good)

    return or_refusal(look, marks=rim)


def _prepare(rgb: Rgb, table: ResamplingTable | None) -> tuple[Mask2, Float]:
    """Return the working area and the picture, both at a quarter of the size; refuse grey ones."""
    require_colour(as_picture(rgb[::SHRINK, ::SHRINK]), where=tr("frame"))
    small = _small(rgb)
    if table is None:
        return np.ones(small.shape[:2], np.bool_), small
    area = working_area(table, rgb.shape[:2]).astype(np.float32)
    size = (small.shape[1], small.shape[0])
    whole = np.asarray(cv2.resize(area, size, interpolation=cv2.INTER_AREA)) > 0.99
    if not whole.any():
        raise InputError(
            tr("the working area is not in the picture"),
            where=tr("frame"),
            advice=tr("Check the working diameter and repeat the top pose"),
        )
    return whole, small


def _small(rgb: Rgb) -> Float:
    rows, columns = rgb.shape[:2]
    size = (columns // SHRINK, rows // SHRINK)
    shrunk = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
    return np.asarray(shrunk, np.float32) / np.float32(end_of_scale(rgb))


def _enlarge(mask: Mask2, rgb: Rgb) -> Mask2:
    size = (rgb.shape[1], rgb.shape[0])
    return np.asarray(cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)) > 0


def _masks(full: Mask2, doubtful: Mask2) -> tuple[Mask, ...]:
    """Return what is saturated and what is doubtful, where there is any."""
    both = (Mask(full, "bad"), Mask(doubtful, "expected"))
    return tuple(mask for mask in both if mask.area.any())


def _brightness_figures(small: Float, area: Mask2) -> tuple[Figure, ...]:
    names = (tr("red"), tr("green"), tr("blue"))
    brightest = 100.0 * np.percentile(small[area], 99.0, axis=0)
    return tuple(
        judge(f"brightest_{k}", tr("Brightest {name}").format(name=names[k]), float(brightest[k]),
              "%", warn=25.0, fail=200.0 * LEAST_LIGHT, higher_is_better=True,
              advice=tr("Switch the {name} LED on, or expose longer").format(name=names[k]))
        for k in range(3)
    )  # fmt: skip


def _saturated_figure(full: Mask2, area: Mask2, *, warn: float, fail: float) -> Figure:
    rows, columns = area.shape
    # The share of a block's pixels, so that not one is lost at a quarter of the size.
    part = cv2.resize(full.astype(np.float32), (columns, rows), interpolation=cv2.INTER_AREA)
    percent = 100.0 * float(np.asarray(part)[area].mean())
    return judge("saturated", tr("Saturated share"), percent, "%", warn=warn, fail=fail,
                 advice=tr("Shorten the exposure until nothing is saturated"))  # fmt: skip


def _without_rim(lit: Mask2) -> Mask2:
    """Return the lit area without the mixed pixels along the board's rim; specks stay in it."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    whole = cv2.morphologyEx(lit.astype(np.uint8), cv2.MORPH_CLOSE, disc)
    return np.asarray(cv2.erode(whole, disc, borderType=cv2.BORDER_REPLICATE)) > 0


def _light_range(small: Float, lit: Mask2) -> float:
    if not lit.any():
        return float("inf")
    inside = small[lit]
    return float((inside.max(axis=0) / np.percentile(inside, 1.0, axis=0)).max())


def _local_change(values: Float, area: Mask2, sigma_px: float) -> Float:
    """Return |value / mean around - 1|, the largest of the channels; the mean is the area's own."""
    weight = area.astype(np.float32)
    around = cv2.GaussianBlur(weight, (0, 0), sigma_px)
    mean = cv2.GaussianBlur(values * weight[..., None], (0, 0), sigma_px)
    mean = np.asarray(mean) / np.maximum(np.asarray(around), 1e-3)[..., None]
    change = np.abs(values / np.maximum(mean, 1e-3) - 1.0)
    return np.asarray(change.max(axis=2), np.float32)


def _refuse_whiteboard(small: Float, whiteboard: Float, area: Mask2) -> None:
    """Refuse the whiteboard itself: no membrane is as bright in all channels and all places."""
    if _is_same(small, whiteboard, area):
        raise InputError(
            tr("the picture looks just like the whiteboard's"),
            where=tr("frame"),
            advice=tr(
                "Mount the membrane; if it is mounted, it was so for the whiteboard's picture:"
                " capture that again"
            ),
        )


def _refuse_membrane(small: Float, background: Float, area: Mask2) -> None:
    """Refuse the bare membrane in the place of the whiteboard, where its picture is known."""
    if _is_same(small, background, area):
        raise InputError(
            tr("the picture looks just like the background's"),
            where=tr("frame"),
            advice=tr("Take the membrane off and press the white board onto the elastomer"),
        )


def _is_same(small: Float, other: Float, area: Mask2) -> bool:
    lit = area & (np.minimum(small, other).min(axis=2) > LEAST_RATIO_LIGHT)
    if not lit.any():
        return False
    off = np.abs(small[lit] / other[lit] - 1.0)
    return float(np.median(off, axis=0).max()) < SAME_PICTURE


def _find_pressed(small: Float, whiteboard: Float, area: Mask2) -> Mask2:
    """Return where the membrane's answer to the light changes as it does around a contact.

    The whiteboard takes the light's own unevenness out; a median takes specks out.
    """
    lit = area & (np.minimum(small, whiteboard).min(axis=2) > LEAST_RATIO_LIGHT)
    ratio = small / np.maximum(whiteboard, LEAST_RATIO_LIGHT)
    smooth = np.asarray(cv2.medianBlur(ratio, 5), np.float32)
    changed = lit & (_local_change(smooth, lit, CONTACT_OF_WIDTH * small.shape[1]) > SPECK_CHANGE)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(changed.astype(np.uint8))
    least = (PRESSED_OF_WIDTH * small.shape[1]) ** 2
    large = [n for n in range(1, count) if stats[n, cv2.CC_STAT_AREA] >= least]
    return np.isin(labels, large)
