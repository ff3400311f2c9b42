"""The views of a lens calibration: which show the board, and which are left out and why."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError
from gelpolight_core.optics.checkerboard import BoardSpec, BoardView, find_board
from gelpolight_core.session.picture import Picture
from gelpolight_core.translation import tr

Array = NDArray[np.float64]

# Three views are the least that Zhang's method needs; the fourth checks them.
MIN_VIEWS = 4
# Two pictures whose corners differ by less are one view taken twice.
DUPLICATE_PX = 0.5


@dataclass(frozen=True, slots=True)
class LensView:
    """What became of one picture.

    Attributes
    ----------
    name : str
        The picture's name.
    used : bool
        Whether it took part in the calibration.
    reason : str
        Why not; empty when it did.
    advice : str
        What to do about it.
    board : BoardView or None
        The corners, where they were found.
    residuals_px : (N, 2) or None
        Projected minus seen corner, of the used views.
    rms_px, held_out_rms_px : float
        Of this view by the camera with it, and by a camera calibrated without it; NaN if unused.
    normal_camera : (3,) or None
        The board's normal, pointing away from the camera.
    distance_mm : float
        Of the board's plane; NaN if unused.
    """

    name: str
    used: bool
    reason: str
    advice: str = ""
    board: BoardView | None = None
    residuals_px: Array | None = None
    rms_px: float = math.nan
    held_out_rms_px: float = math.nan
    normal_camera: Array | None = None
    distance_mm: float = math.nan


def more_views_advice() -> str:
    """Return the advice to whoever has too few views, or too much alike."""
    return tr("Capture 10 or more sharp views of the board, tilted by 15 to 40 degrees either way")


def look_for_board(picture: Picture, board: BoardSpec) -> LensView:
    """Look for the board in a picture; a picture without it is an unused view, no error.

    Parameters
    ----------
    picture : Picture
        Any size.
    board : BoardSpec
        The board that should be there.

    Returns
    -------
    LensView
        Used, with its corners, or unused, with the reason.
    """
    try:
        return LensView(picture.name, True, "", board=find_board(picture, board))
    except InputError as refusal:
        return LensView(picture.name, False, refusal.found, refusal.advice)


def leave_out_duplicates(views: list[LensView]) -> list[LensView]:
    """Leave out views that show the board just as an earlier one does.

    Parameters
    ----------
    views : list of LensView
        In the order of the pictures.

    Returns
    -------
    list of LensView
        The same views; duplicates are unused and name their twin.
    """
    kept: list[LensView] = []
    for view in views:
        twin = next((other for other in kept if _same_pose(view, other)), None)
        if twin is not None:
            reason = tr("shows the board just as {name} does").format(name=twin.name)
            view = replace(view, used=False, reason=reason)
        kept.append(view)
    return kept


def _same_pose(view: LensView, other: LensView) -> bool:
    if not (view.used and other.used) or view.board is None or other.board is None:
        return False
    apart = view.board.corners_px - other.board.corners_px
    return float(np.sqrt(np.mean(np.sum(apart**2, axis=1)))) < DUPLICATE_PX


def require_views(views: Sequence[LensView]) -> None:
    """Refuse views of which too few can be used, naming what is wrong with the others.

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
    refused: dict[str, list[LensView]] = {}
    for view in views:
        if not view.used:
            refused.setdefault(view.reason, []).append(view)
    groups = sorted(refused.values(), key=len, reverse=True)
    raise InputError(
        tr("{n} of {m} views can be used, at least {k} are needed ({why})").format(
            n=used,
            m=len(views),
            k=MIN_VIEWS,
            why="; ".join(f"{_names(group)}: {group[0].reason}" for group in groups),
        ),
        where=tr("checkerboard"),
        advice=groups[0][0].advice or more_views_advice(),
    )


def _names(views: Sequence[LensView]) -> str:
    if len(views) <= 4:
        return ", ".join(view.name for view in views)
    return tr("{first} and {n} others").format(first=views[0].name, n=len(views) - 1)
