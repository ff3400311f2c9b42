"""The light in the images of balls: its change, and a channel without light."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.health.fault_limits import SIGMAS
from gelpolight_core.health.global_change import GlobalChange
from gelpolight_core.health.health_check import HealthCheck
from gelpolight_core.sensor.closed_sensor.closed_sensor_data import ClosedSensor
from gelpolight_core.sensor.closed_sensor.colour_change import SMOOTHING_NODES
from gelpolight_core.sensor.closed_sensor.polynomial_terms import TERMS
from gelpolight_core.sensor.closed_sensor.slope_model import COLOUR_CELLS, ErrorCurve, InPlaceModel
from gelpolight_core.sensor.closed_sensor.working_grid import WorkingGrid
from gelpolight_core.stages.balls.contact_contour import ImageCircle

PressLights = Mapping[str, tuple[GlobalChange, Mapping[str, float]]]


@dataclass(frozen=True, slots=True)
class BallImage:
    """An image of a pressed ball with what is stated of it.

    Attributes
    ----------
    name : str
        Its file.
    rgb : (height, width, 3) float32
        Linear light.
    radius_mm : float
        Radius of the ball.
    placed : ImageCircle or None
        Contact drawn by hand, camera pixels.
    """

    name: str
    rgb: Float32Array
    radius_mm: float
    placed: ImageCircle | None = None


def press_lights(
    presses: Sequence[BallImage], grid: WorkingGrid, background: Float32Array, noise: Float64Array
) -> PressLights:
    """Return the change of light in each image of a pressed ball, by its name.

    Parameters
    ----------
    presses : sequence of BallImage
        The images.
    grid : WorkingGrid
        Nodes and scale.
    background : (rows, columns, 3) float32
        The untouched membrane on the grid.
    noise : (3,)
        Standard deviation of a pixel of a single image.
    """
    colours = np.zeros((COLOUR_CELLS,) * 3, np.float32)
    errors = ErrorCurve(np.arange(2.0), np.zeros(2), 0.0, 0.0)
    bare = InPlaceModel(grid, background, np.zeros((TERMS, 2)), colours, 0.0, errors)
    check = HealthCheck(ClosedSensor("", bare, noise, ()))
    return {press.name: check.change(press.rgb) for press in presses}


def share_as_background(lights: PressLights) -> float:
    """Return the share of the membrane around the balls that looks like the background, median."""
    return float(np.median([common.share for common, _ in lights.values()]))


def own_responses(images: Sequence[Float32Array], background: Float32Array) -> Float64Array:
    """Return the change of each channel by itself, as a multiple of its noise (3,).

    The part of a channel that the two others explain is left out: without light of its own, a
    channel only sees a share of theirs.

    Parameters
    ----------
    images : sequence of (rows, columns, 3) float32
        With balls at different places, on the working grid.
    background : (rows, columns, 3) float32
        The untouched membrane.
    """
    changes, fine = [], []
    for image in images:
        change = np.nan_to_num(image - background)
        smooth = cv2.GaussianBlur(change, (0, 0), SMOOTHING_NODES)
        fine.append(((change - smooth) ** 2).mean(axis=(0, 1)))
        changes.append(smooth.reshape(-1, 3))
    samples = np.concatenate(changes).astype(np.float64)
    # An average under a Gaussian leaves this part of the noise of a node.
    noise = np.sqrt(np.median(fine, axis=0)) / (2.0 * np.sqrt(np.pi) * SMOOTHING_NODES)
    covariance = samples.T @ samples / len(samples)
    responses = []
    for channel in range(3):
        others = [k for k in range(3) if k != channel]
        among = covariance[np.ix_(others, others)]
        shared = covariance[others, channel]
        part = shared @ np.linalg.lstsq(among, shared, rcond=None)[0]
        responses.append(np.sqrt(max(covariance[channel, channel] - part, 0.0)))
    return np.asarray(responses / np.maximum(noise, np.finfo(np.float32).eps))


def refuse_dead_channel(images: Sequence[Float32Array], background: Float32Array) -> None:
    """Refuse images in which a channel shows nothing that the two others do not.

    Parameters
    ----------
    images, background
        As for :func:`own_responses`.

    Raises
    ------
    InputError
        With the name of the channel.
    """
    responses = own_responses(images, background)
    weakest = int(responses.argmin())
    if responses[weakest] < SIGMAS <= responses.max():
        text = f"The {CHANNEL_KEYS[weakest]} channel shows no light of its own"
        raise InputError(text, "balls", Remedy.LIGHT_ON)
