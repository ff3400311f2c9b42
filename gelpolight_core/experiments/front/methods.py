"""Methods from image to depth for the comparison, each with a name and a family."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError
from gelpolight_core.experiments.front.scene import Scene
from gelpolight_core.experiments.integrators.others import shifted_cosine_transform
from gelpolight_core.experiments.plain_paper import plain_depth, plain_slopes
from gelpolight_core.experiments.rivals.directional_table import fit_table
from gelpolight_core.experiments.rivals.network import fit_network, read_network
from gelpolight_core.experiments.rivals.polynomial import fit_polynomial
from gelpolight_core.experiments.rivals.samples import (
    BallSamples,
    Predict,
    relative_change,
)
from gelpolight_core.reconstruction.integration.poisson import PoissonSolver
from gelpolight_core.reconstruction.linear import as_linear
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.trace import EFFORTS
from gelpolight_core.translation import tr

Map = NDArray[np.floating[Any]]
Slopes = tuple[Map, Map]
Solve = Callable[[NDArray[Any]], tuple[Map, Slopes]]
THREADS = 2


@dataclass(frozen=True, slots=True)
class Method:
    """A method from image to depth.

    Attributes
    ----------
    name, label : str
        For files, and for people.
    family : str
        Its family: ``paper``, ``effort``, ``precision``, ``rival`` or ``rival_wrong``.
    make : callable
        Prepares it for a scene: returns a function from frame to depth and its slopes.
    """

    name: str
    label: str
    family: str
    make: Callable[[Scene], Solve]


class Rivals:
    """The methods that learn from ball presses, each trained once per sensor.

    Parameters
    ----------
    seed : int, optional
        Of the network.
    """

    def __init__(self, seed: int = 0) -> None:
        self._seed = seed
        self._trained: dict[tuple[str, str], Predict] = {}

    def predict(self, kind: str, scene: Scene) -> Predict:
        """Return the trained function of a rival for the sensor of a scene."""
        if scene.samples is None:
            raise InputError(
                tr("There are no ball presses to learn from"),
                where=scene.sensor,
                advice=tr("Measure a session folder with balls"),
            )
        key = (kind, scene.sensor)
        if key not in self._trained:
            self._trained[key] = self._learn(kind, scene.samples, scene.kept)
        return self._trained[key]

    def _learn(self, kind: str, samples: BallSamples, kept: Path | None) -> Predict:
        """Train, or read the result of an earlier run."""
        if kind == "table":
            return fit_table(samples)
        if kind == "polynomial":
            return fit_polynomial(samples)
        file = None if kept is None else kept / f"network-{self._seed}.npz"
        if file is not None and file.is_file():
            return read_network(file)
        network = fit_network(samples, seed=self._seed)
        if file is not None:
            network.write(file)
        return network


def methods(*, seed: int = 0) -> tuple[Method, ...]:
    """Return all methods, ours first.

    Parameters
    ----------
    seed : int, optional
        Of what is trained at random.
    """
    found = [Method("paper", tr("paper's model"), "paper", _by_model("paper"))]
    for effort in EFFORTS:
        label = tr("full model, {effort}").format(effort=effort)
        found.append(Method(f"full_{effort}", label, "effort", _by_model("full", effort)))
    found.append(
        Method("paper_plain", tr("paper's model, plain NumPy, double"), "precision", _plain)
    )
    rivals = Rivals(seed)
    labels = {
        "table": tr("directional table"),
        "polynomial": tr("polynomial in colour and position"),
        "network": tr("neural network"),
    }
    for kind, label in labels.items():
        found.append(Method(kind, label, "rival", partial(_rival, rivals, kind, False)))
        wrong = tr("{method}, wrong eigenvalues").format(method=label)
        found.append(
            Method(f"{kind}_wrong", wrong, "rival_wrong", partial(_rival, rivals, kind, True))
        )
    return tuple(found)


def _by_model(model: str, effort: str = "best") -> Callable[[Scene], Solve]:
    def make(scene: Scene) -> Solve:
        calibration = scene.paper if model == "paper" else scene.full
        reconstruct = Reconstructor(calibration, model=model, effort=effort, workers=THREADS)

        def solve(frame: NDArray[Any]) -> tuple[Map, Slopes]:
            found = reconstruct.depth(frame, normals=True)
            assert found.normals is not None
            down = np.minimum(found.normals[..., 2], -1e-3)
            return found.depth_mm, (found.normals[..., 0] / down, found.normals[..., 1] / down)

        return solve

    return make


def _plain(scene: Scene) -> Solve:
    pitch = scene.paper.table.grid.pitch_mm

    def solve(frame: NDArray[Any]) -> tuple[Map, Slopes]:
        slope_x, slope_y = plain_slopes(frame, scene.paper)
        return plain_depth(slope_x, slope_y, pitch), (slope_x, slope_y)

    return solve


def _rival(rivals: Rivals, kind: str, wrong: bool, scene: Scene) -> Solve:
    """Return a rival on the scene's grid, with a correct integrator or with the common faults."""
    predict, background, table = rivals.predict(kind, scene), scene.background, scene.full.table
    valid, grid = table.valid, table.grid
    position = grid.points_mm()[valid].astype(np.float32)
    solver = PoissonSolver(*grid.shape, pitch_mm=grid.pitch_mm, workers=THREADS)
    border = np.zeros(grid.shape, bool)
    border[[0, -1], :] = border[:, [0, -1]] = True

    def solve(frame: NDArray[Any]) -> tuple[Map, Slopes]:
        change = relative_change(table.apply(as_linear(frame)), background)
        slopes = np.zeros((*grid.shape, 2), np.float32)
        slopes[valid] = predict(change[valid], position)
        slope_x, slope_y = (np.ascontiguousarray(slopes[..., k]) for k in (0, 1))
        if wrong:
            depth = shifted_cosine_transform(slope_x, slope_y, grid.pitch_mm)
            # Its constant is free; depth 0 at the border is the best assumption.
            return depth - np.median(depth[border]), (slope_x, slope_y)
        return solver.integrate(slope_x, slope_y).depth_mm, (slope_x, slope_y)

    return solve
