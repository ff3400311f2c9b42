"""Other methods from colour to depth, trained on the ball presses that the calibration uses.

    python -m tests.studies.rivals SESSION

SESSION holds presses with their true depth. A table from colour to slope as if light were parallel,
a ridge polynomial and a small neural network in colour and position; each is integrated correctly,
and with the faults that are common in open tactile libraries. They are as strong as they can be:
they learn the true slopes of the balls and of the drape around them, along the camera's rays, where
published ones learn those of a sphere seen from straight above. Balls have slopes up to 38 degrees,
the presses up to 57. Beside them: the paper's model and the full model, from the same session. Each
row is the mean absolute error over the presses.
"""

from collections.abc import Callable, Iterator
from itertools import combinations_with_replacement, pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import distance_transform_edt

from gelpolight_core.calibration.open_ball_stages import BALLS
from gelpolight_core.calibration.open_sensor_recipe import BACKGROUND, TOP_POSE
from gelpolight_core.calibration.recipe import StageResults
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.lab.depth_score import score_depth, scored_radius_mm
from gelpolight_core.reconstruction.linearise import as_linear, linearise_frame
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.session.session import read_session
from gelpolight_core.stages.balls.ball_press import BallPress
from gelpolight_core.stages.balls.draped_ball import draped_ball
from tests.slopes import integrate_slopes
from tests.studies.integrators import shifted_cosine_transform
from tests.studies.presses import (
    TruePress,
    folder_named,
    full_calibration,
    show,
    stage_results,
    true_presses,
)

Predict = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""From relative changes (N, 3) and positions in mm (N, 2) to slopes (N, 2)."""
FLAT_PIXELS, AWAY_MM = 4000, 2.0
"""Pixels that are farther than this from the contact of each press; nearer ones are all used."""
DARK = 0.01
"""A background below this share of full scale has no ratio."""
BINS, SPREAD = 48, 99.8
DEGREE, CLIP = 3, 3.0
"""Of the polynomial; inputs are clipped at this number of standard deviations."""
PENALTIES = tuple(10.0**power for power in range(-8, 0))
UNITS, MOST_SAMPLES = (128, 32, 32), 200_000
STEPS, BATCH, RATE, DECAYS = 6000, 512, 1e-2, (0.9, 0.999)
MOST_ANGLE = 1.4


class Samples(NamedTuple):
    """Pixels of ball presses: I / I0 - 1 (N, 3), position (N, 2), slopes (N, 2), press (N,)."""

    change: np.ndarray
    position_mm: np.ndarray
    slopes: np.ndarray
    ball: np.ndarray


def relative_change(light: np.ndarray, background: np.ndarray) -> np.ndarray:
    """Return I / I0 - 1 (..., 3) of linear light; 0 where the background is dark."""
    lit = background > DARK
    return np.where(lit, light / np.where(lit, background, 1.0) - 1.0, 0.0).astype(np.float32)


def ball_samples(results: StageResults, decay_mm: float) -> Samples:
    """Return the pixels of all ball presses: the ball, its drape, and some far outside."""
    table, background, balls = results[TOP_POSE].table, results[BACKGROUND].light, results[BALLS]
    parts = [
        _samples_of(number, press, relative_change(image, background), table, decay_mm)
        for number, (press, image) in enumerate(zip(balls.presses, balls.images, strict=True))
    ]
    return Samples(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def _samples_of(
    number: int, press: BallPress, change: np.ndarray, table: ResamplingTable, decay_mm: float
) -> Samples:
    x, y = np.meshgrid(table.grid.x_mm, table.grid.y_mm)
    far = np.hypot(x - press.pose.centre_mm[0], y - press.pose.centre_mm[1])
    far -= press.contact_radius_mm
    around = np.argwhere((far <= AWAY_MM) & table.valid)
    beside = np.argwhere((far > AWAY_MM) & table.valid)
    beside = np.random.default_rng(0).permutation(beside)[:FLAT_PIXELS]
    rows, columns = np.concatenate([around, beside]).T
    position = np.stack([table.grid.x_mm[columns], table.grid.y_mm[rows]], axis=-1)
    rays = table.ray_slope[rows, columns].astype(np.float64)
    normals = draped_ball(position, rays, press.pose, decay_mm=decay_mm)[1]
    values = (change[rows, columns], position, normals[:, :2] / normals[:, 2:])
    return Samples(*(a.astype(np.float32) for a in values), np.full(rows.size, number))


def fit_table(samples: Samples) -> Predict:
    """Fill the table n = F(I) (the paper's Eq. 2) with the mean slope of each colour.

    Colours that no ball has shown get the slope of the nearest colour of a ball.
    """
    low, high = np.percentile(samples.change, [100.0 - SPREAD, SPREAD], axis=0)
    step = np.maximum((high - low) / BINS, 1e-6)

    def bins(change: np.ndarray) -> tuple[np.ndarray, ...]:
        return tuple(np.clip((change - low) / step, 0, BINS - 1).astype(np.int32).T)

    count, sums = np.zeros((BINS,) * 3), np.zeros((*(BINS,) * 3, 2))
    np.add.at(count, bins(samples.change), 1)
    np.add.at(sums, bins(samples.change), samples.slopes)
    mean = sums / np.maximum(count, 1)[..., None]
    nearest = distance_transform_edt(count == 0, return_distances=False, return_indices=True)
    table = mean[tuple(nearest)].astype(np.float32)
    return lambda change, _position: table[bins(change)]


def fit_polynomial(samples: Samples) -> Predict:
    """Fit slopes to powers of colour ratio and position.

    The penalty is the one with the smallest error on balls that were left out.
    """
    inputs = np.concatenate([samples.change, samples.position_mm], axis=1)
    middle, spread = inputs.mean(axis=0), inputs.std(axis=0) + 1e-9
    sums = []
    for number in np.unique(samples.ball):
        mine = samples.ball == number
        terms, slopes = _terms((inputs[mine] - middle) / spread), samples.slopes[mine]
        sums.append((terms.T @ terms, terms.T @ slopes, float((slopes**2).sum())))

    def fitted(kept: list[tuple[Any, ...]], penalty: float) -> np.ndarray:
        gram, right = (np.sum([part[k] for part in kept], axis=0) for k in (0, 1))
        ridge = penalty * np.trace(gram) / len(gram)
        return np.linalg.solve(gram + ridge * np.eye(len(gram)), right)

    def left_out_error(penalty: float) -> float:
        total = 0.0
        for k, (gram, right, square) in enumerate(sums):
            w = fitted(sums[:k] + sums[k + 1 :], penalty)
            total += float(np.sum(w * (gram @ w)) - 2.0 * np.sum(w * right)) + square
        return total

    weights = fitted(sums, min(PENALTIES, key=left_out_error))

    def predict(change: np.ndarray, position_mm: np.ndarray) -> np.ndarray:
        given = (np.concatenate([change, position_mm], axis=1) - middle) / spread
        return _terms(np.clip(given, -CLIP, CLIP)) @ weights

    return predict


def _terms(inputs: np.ndarray) -> np.ndarray:
    """Return all products of at most `DEGREE` inputs, (N, terms)."""
    columns = [np.ones(len(inputs))]
    for degree in range(1, DEGREE + 1):
        for chosen in combinations_with_replacement(range(inputs.shape[1]), degree):
            columns.append(np.prod(inputs[:, chosen], axis=1, dtype=np.float64))
    return np.stack(columns, axis=1)


def fit_network(samples: Samples, *, seed: int = 0, steps: int = STEPS) -> Predict:
    """Train a network as the open tactile libraries do: three hidden layers of rectified units.

    It learns the angles of the slopes with Adam (Kingma and Ba 2015) at a rate that falls to 0.
    """
    rng = np.random.default_rng(seed)
    kept = rng.permutation(len(samples.ball))[:MOST_SAMPLES]
    inputs = np.concatenate([samples.change, samples.position_mm], axis=1)[kept]
    middle, spread = inputs.mean(axis=0), inputs.std(axis=0) + np.float32(1e-9)
    inputs, angles = (inputs - middle) / spread, np.arctan(samples.slopes[kept])
    layers: list[np.ndarray] = []  # weights and bias of each layer, one after the other
    for a, b in pairwise((inputs.shape[1], *UNITS, 2)):
        # He et al. 2015: keeps the variance constant from layer to layer.
        layers.append((rng.standard_normal((a, b)) * np.sqrt(2.0 / a)).astype(np.float32))
        layers.append(np.zeros(b, np.float32))
    mean, square = ([np.zeros_like(p) for p in layers] for _ in (0, 1))
    for step in range(1, steps + 1):
        part = rng.integers(0, len(inputs), BATCH)
        rate = 0.5 * RATE * (1.0 + np.cos(np.pi * step / steps))
        for n, gradient in enumerate(_gradients(layers, inputs[part], angles[part])):
            mean[n] += np.float32(1.0 - DECAYS[0]) * (gradient - mean[n])
            square[n] += np.float32(1.0 - DECAYS[1]) * (gradient**2 - square[n])
            even_mean, even_square = (
                m[n] / (1.0 - d**step) for m, d in zip((mean, square), DECAYS, strict=True)
            )
            layers[n] -= (rate * even_mean / (np.sqrt(even_square) + 1e-8)).astype(np.float32)

    def predict(change: np.ndarray, position_mm: np.ndarray) -> np.ndarray:
        given = (np.concatenate([change, position_mm], axis=1) - middle) / spread
        return np.tan(np.clip(_values(layers, given)[-1], -MOST_ANGLE, MOST_ANGLE))

    return predict


def _values(layers: list[np.ndarray], inputs: np.ndarray) -> list[np.ndarray]:
    """Return the inputs of every layer, and the result."""
    values = [inputs]
    for n in range(0, len(layers), 2):
        value = values[-1] @ layers[n] + layers[n + 1]
        values.append(value if n == len(layers) - 2 else np.maximum(value, 0.0))
    return values


def _gradients(
    layers: list[np.ndarray], inputs: np.ndarray, wanted: np.ndarray
) -> list[np.ndarray]:
    """Return the derivatives of the mean squared error: weights and bias of each layer."""
    values = _values(layers, inputs)
    error = (values[-1] - wanted) * np.float32(2.0 / len(inputs))
    found: list[np.ndarray] = []
    for weights, given in zip(layers[-2::-2], values[-2::-1], strict=True):
        found = [given.T @ error, error.sum(axis=0), *found]
        error = (error @ weights.T) * (given > 0.0)
    return found


FITS = {"table": fit_table, "polynomial": fit_polynomial, "network": fit_network}


def compare(
    full: Calibration, results: StageResults, presses: list[TruePress], fits: Any = FITS
) -> Iterator[dict[str, Any]]:
    """Yield the errors of each method on the presses; `full` is the calibration by `results`."""
    table, background = full.table, results[BACKGROUND].light
    grid, valid = table.grid, table.valid
    radius_mm = scored_radius_mm(full.data.sensor)
    assert full.data.full is not None
    samples = ball_samples(results, full.data.full.decay_mm)

    def errors(depth_of: Callable[[TruePress], np.ndarray]) -> dict[str, float]:
        scores = [
            score_depth(
                depth_of(press).astype(np.float32),
                grid.x_mm,
                grid.y_mm,
                press.truth,
                height_mm=press.height_mm,
                radius_mm=radius_mm,
            )
            for press in presses
        ]
        table = np.abs([(s.height_percent, s.size_percent, s.rms_um) for s in scores])
        return dict(zip(("height %", "size %", "RMS um"), table.mean(axis=0).tolist(), strict=True))

    for model in ("paper", "full"):
        ours = Reconstructor(full, model=model)
        yield {"method": model, **errors(lambda press, ours=ours: ours.depth(press.frame).depth_mm)}
    for name, fit in fits.items():
        predict = fit(samples)

        def slopes(press: TruePress, predict: Predict = predict) -> tuple[np.ndarray, np.ndarray]:
            light = table.apply(as_linear(linearise_frame(press.frame, full.response)))
            found = np.zeros((2, *grid.shape), np.float32)
            change = relative_change(light, background)[valid]
            found[:, valid] = predict(change, grid.points_mm()[valid].astype(np.float32)).T
            return found[0], found[1]

        def shifted(press: TruePress, slopes: Any = slopes) -> np.ndarray:
            depth = shifted_cosine_transform(*slopes(press), grid.pitch_mm)
            # Its constant is free; depth 0 at the border is the best assumption.
            border = [depth[0], depth[-1], depth[:, 0], depth[:, -1]]
            return depth - np.median(np.concatenate(border))

        def right(press: TruePress, slopes: Any = slopes) -> np.ndarray:
            return integrate_slopes(*slopes(press), pitch_mm=grid.pitch_mm)

        yield {"method": name, **errors(right)}
        yield {"method": f"{name}, wrong eigenvalues", **errors(shifted)}


if __name__ == "__main__":
    own = read_session(folder_named())
    found = stage_results(own)
    made = full_calibration(own, found)
    show(compare(made, found, true_presses(own)))
