"""The views of a lens calibration, used or left out with a reason."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.errors import InputError
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.session.board import BoardSpec

from .checkerboard import BoardView, find_board

# Zhang's method needs at least three views; the fourth checks them.
MIN_VIEWS = 4


@dataclass(frozen=True, slots=True)
class LensView:
    """One image of the board, used or left out.

    Attributes
    ----------
    name : str
        Name of the image.
    used : bool
        Whether it is part of the calibration.
    reason : str
        Why it is not used; empty if it is.
    advice : str
        What to do about it.
    board : BoardView or None
        The corners, if they were found.
    residuals_px : (N, 2) or None
        Projected minus measured corner, if used.
    rms_px : float
        Reprojection error; NaN if unused.
    """

    name: str
    used: bool
    reason: str
    advice: str = ""
    board: BoardView | None = None
    residuals_px: Float64Array | None = None
    rms_px: float = math.nan


class LensRefusal(InputError):
    """A lens calibration that failed, with what was found in each view.

    Parameters
    ----------
    fault : InputError
        Why it failed.
    views : sequence of LensView
        All views; those that were left out are named in the message with their reasons.
    """

    def __init__(self, fault: InputError, views: Sequence[LensView]) -> None:
        self.views = tuple(views)
        unused = f"; left out: {excluded_views_text(views)}"
        named = not any(not view.used and view.reason not in fault.found for view in views)
        text = fault.found if named else fault.found + unused
        super().__init__(text, where=fault.where, advice=fault.advice)


def excluded_views_text(views: Sequence[LensView]) -> str:
    """Return the unused views with their reasons, the most frequent reason first."""
    refused: dict[str, list[LensView]] = {}
    for view in views:
        if not view.used:
            refused.setdefault(view.reason, []).append(view)
    groups = sorted(refused.values(), key=len, reverse=True)
    return "; ".join(f"{_names(group)}: {group[0].reason}" for group in groups)


def more_views_advice() -> str:
    """Return the advice for too few or too similar views."""
    return (
        "Capture more sharp views of the board, tilted by 15 to 40 degrees in different directions"
    )


def find_view(image: LinearImage, board: BoardSpec) -> LensView:
    """Return a view of an image, unused where the board is not found.

    Parameters
    ----------
    image : LinearImage
        Any size.
    board : BoardSpec
        The expected board.

    Returns
    -------
    LensView
        Used, with its corners, or unused, with the reason.
    """
    try:
        return LensView(image.name, True, "", board=find_board(image, board))
    except InputError as refusal:
        return refused_view(image.name, refusal)


def refused_view(name: str, fault: InputError) -> LensView:
    """Return the unused view for an image that cannot be used, with the reason."""
    return LensView(name, False, fault.found, fault.advice)


def leave_out_duplicates(views: list[LensView]) -> list[LensView]:
    """Leave out views that show the board in the same pose as an earlier one.

    Parameters
    ----------
    views : list of LensView
        In the order of the images.

    Returns
    -------
    list of LensView
        The same views; duplicates are unused and name the earlier view.
    """
    checked: list[LensView] = []
    for view in views:
        twin = next((other for other in checked if _same_pose(view, other)), None)
        if twin is not None:
            reason = f"The board has the same pose as in {twin.name}"
            view = replace(view, used=False, reason=reason)
        checked.append(view)
    return checked


def _same_pose(view: LensView, other: LensView) -> bool:
    if not (view.used and other.used) or view.board is None or other.board is None:
        return False
    distance_px = view.board.corners_px - other.board.corners_px
    # Two images whose corners differ by less than half a pixel show the same view twice.
    return float(np.sqrt(np.mean(np.sum(distance_px**2, axis=1)))) < 0.5


def require_views(views: Sequence[LensView]) -> None:
    """Refuse a set with too few usable views, and name the faults of the others.

    Parameters
    ----------
    views : sequence of LensView
        Used or not.

    Raises
    ------
    InputError
        If fewer than 4 are used.
    """
    used = sum(view.used for view in views)
    if used >= MIN_VIEWS:
        return
    unused = [view for view in views if not view.used]
    advices = [view.advice for view in unused if view.advice]
    text = f"Only {used} of {len(views)} views can be used, but at least {MIN_VIEWS} are needed"
    advice = max(advices, key=advices.count) if advices else more_views_advice()
    raise InputError(f"{text} ({excluded_views_text(views)})", "checkerboard", advice)


def _names(views: Sequence[LensView]) -> str:
    if len(views) <= 4:
        return ", ".join(view.name for view in views)
    return f"{views[0].name} and {len(views) - 1} others"
