"""Whether every colour channel shows the presses: a slope needs the light of three directions."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.arrays import Map
from gelpolight_core.channels import CHANNEL_KEYS
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.light.limits import SIGMAS
from gelpolight_core.reconstruction.in_place.change import SMOOTHING_NODES


def own_responses(images: Sequence[Map], background: Map) -> NDArray[np.float64]:
    """Return how much each channel changes by itself, as a multiple of its noise (3,).

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
    seen = np.concatenate(changes).astype(np.float64)
    # An average under a Gaussian leaves this part of the noise of a node.
    noise = np.sqrt(np.median(fine, axis=0)) / (2.0 * np.sqrt(np.pi) * SMOOTHING_NODES)
    covariance = seen.T @ seen / len(seen)
    own = []
    for channel in range(3):
        others = [k for k in range(3) if k != channel]
        known, shared = covariance[np.ix_(others, others)], covariance[others, channel]
        part = shared @ np.linalg.lstsq(known, shared, rcond=None)[0]
        own.append(np.sqrt(max(covariance[channel, channel] - part, 0.0)))
    return np.asarray(own / np.maximum(noise, np.finfo(np.float32).eps))


def refuse_dead_channel(images: Sequence[Map], background: Map) -> None:
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
        raise InputError(
            f"The {CHANNEL_KEYS[weakest]} channel shows no light of its own",
            "balls",
            Remedy.LIGHT_ON,
        )
