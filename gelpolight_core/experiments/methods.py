"""Ways to get depth from a picture, to be compared: each with a name and a curve it belongs to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.calibration.results import StageResults, need
from gelpolight_core.calibration.terms import ALL_CALIBRATION_TERMS
from gelpolight_core.experiments.ablation import VARIANTS
from gelpolight_core.experiments.directional_table import (
    BallSamples,
    DirectionalTable,
    fit_directional_table,
)
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.reconstruction.plain import plain_depth, plain_slopes
from gelpolight_core.reconstruction.plan import EFFORTS
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.terms import ALL_TERMS, Terms
from gelpolight_core.reflectance.press import BallPress, contact_mask
from gelpolight_core.translation import tr

Map = NDArray[np.float32]
Slopes = tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]]]
Solve = Callable[[NDArray[Any]], tuple[NDArray[np.floating[Any]], Slopes]]
FLAT_PIXELS = 4000
AWAY_MM = 4.0
THREADS = 2


@dataclass(frozen=True, slots=True)
class Scene:
    """A calibrated sensor.

    Attributes
    ----------
    results : StageResults
        Of its stages.
    paper, full : Calibration
        By the paper's model, and refined.
    """

    results: StageResults
    paper: Calibration
    full: Calibration


@dataclass(frozen=True, slots=True)
class Method:
    """A way to get depth from a picture.

    Attributes
    ----------
    name, label : str
        For files, and for people.
    family : str
        What it is a variation of: ``baseline``, ``paper``, ``effort``, ``term``, ``threads``,
        ``precision``.
    make : callable
        Makes it ready for a scene: returns a function from frame to depth and its slopes.
    """

    name: str
    label: str
    family: str
    make: Callable[[Scene], Solve]


def methods() -> tuple[Method, ...]:
    """Return all methods."""
    found = [
        Method("directional", tr("directional table, n = F(I)"), "baseline", _directional),
        Method("paper", tr("paper's model"), "paper", _by_model("paper")),
        Method(
            "paper_1_thread",
            tr("paper's model, 1 thread"),
            "threads",
            _by_model("paper", workers=1),
        ),
        Method(
            "paper_plain_double",
            tr("paper's model, plain NumPy in double precision"),
            "precision",
            _plain,
        ),
    ]
    for effort in EFFORTS:
        label = tr("full model, {effort}").format(effort=effort)
        found.append(Method(f"full_{effort}", label, "effort", _by_model("full", effort=effort)))
    found.append(
        Method(
            "full_1_thread",
            tr("full model, best, 1 thread"),
            "threads",
            _by_model("full", workers=1),
        )
    )
    for variant in VARIANTS:
        if variant.model == "full" and variant.calibration == ALL_CALIBRATION_TERMS:
            label = tr("full: {what}").format(what=tr(variant.label))
            make = _by_model("full", terms=variant.terms)
            found.append(Method(variant.name, label, "term", make))
    return tuple(found)


def _by_model(
    model: str, *, effort: str = "best", terms: Terms = ALL_TERMS, workers: int = THREADS
) -> Callable[[Scene], Solve]:
    def make(scene: Scene) -> Solve:
        calibration = scene.paper if model == "paper" else scene.full
        reconstruct = Reconstructor(
            calibration, model=model, terms=terms, effort=effort, workers=workers
        )

        def solve(frame: NDArray[Any]) -> tuple[NDArray[np.floating[Any]], Slopes]:
            found = reconstruct.depth(frame, normals=True)
            assert found.normals is not None
            down = np.minimum(found.normals[..., 2], -1e-3)
            return found.depth_mm, (found.normals[..., 0] / down, found.normals[..., 1] / down)

        return solve

    return make


def _plain(scene: Scene) -> Solve:
    pitch = scene.paper.table.grid.pitch_mm

    def solve(frame: NDArray[Any]) -> tuple[NDArray[np.floating[Any]], Slopes]:
        slope_x, slope_y = plain_slopes(frame, scene.paper)
        return plain_depth(slope_x, slope_y, pitch), (slope_x, slope_y)

    return solve


def _directional(scene: Scene) -> Solve:
    fitted = directional_table(scene.results)

    def solve(frame: NDArray[Any]) -> tuple[NDArray[np.floating[Any]], Slopes]:
        depth, slope_x, slope_y = fitted.depth(frame)
        return depth, (slope_x, slope_y)

    return solve


def directional_table(results: StageResults) -> DirectionalTable:
    """Fill the directional table from the ball presses of a calibration.

    Raises
    ------
    InputError
        If an earlier stage has no result, or the balls show too little.
    """
    table = need(results.table, tr("directional table"))
    background = need(results.background, tr("directional table"))
    pairs = list(zip(results.presses, results.pictures, strict=True))
    samples = [_ball_samples(press, picture - background, table) for press, picture in pairs]
    flat = [_flat_samples(press, picture - background, table) for press, picture in pairs]
    return fit_directional_table(samples, background, table, flat=_joined(flat))


def _joined(parts: Sequence[Map]) -> Map:
    return np.concatenate([np.empty((0, 3), np.float32), *parts])


def _ball_samples(press: BallPress, change: Map, table: ResamplingTable) -> BallSamples:
    rows, columns = np.nonzero(contact_mask(press, table) & table.valid)
    if not rows.size:
        return BallSamples(np.empty((0, 3), np.float32), np.empty((0, 2), np.float32))
    drift = table.drift[rows, columns].mean(axis=0).astype(np.float64)
    away = np.stack([table.grid.x_mm[columns], table.grid.y_mm[rows]], axis=-1)
    away -= press.seen_centre_mm(drift)
    below = np.sqrt(np.maximum(press.pose.radius_mm**2 - (away**2).sum(axis=1), 1e-6))
    slopes = -away / below[:, None]
    return BallSamples(change[rows, columns], slopes.astype(np.float32))


def _flat_samples(press: BallPress, change: Map, table: ResamplingTable) -> Map:
    x, y = np.meshgrid(table.grid.x_mm, table.grid.y_mm)
    centre = press.pose.centre_mm
    far = np.hypot(x - centre[0], y - centre[1]) > press.contact_radius_mm + AWAY_MM
    flat = change[far & table.valid]
    chosen = np.random.default_rng(0).permutation(len(flat))[:FLAT_PIXELS]
    picked: Map = flat[chosen]
    return picked
