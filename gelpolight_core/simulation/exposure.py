"""From brightness to pixel values: blur, crosstalk, noise, saturation, response, quantisation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from gelpolight_core.base.arrays import Float64Array, PixelArray

from .design_parts import CameraDesign


def blurred(image: NDArray[np.floating], sigma_px: float) -> Float64Array:
    """Return the image after the Gaussian blur of the optics."""
    if sigma_px <= 0.0:
        return np.asarray(image)
    sigma = (sigma_px, sigma_px) + (0.0,) * (image.ndim - 2)
    return np.asarray(gaussian_filter(image, sigma, mode="nearest", truncate=5.0))


def mixed(brightness: Float64Array, crosstalk: tuple[tuple[float, ...], ...]) -> Float64Array:
    """Return camera channels (rows, columns, 3) from the light of the lamps (rows, columns, 3)."""
    return np.asarray(brightness @ np.array(crosstalk).T)


def encoded(light: Float64Array, camera: CameraDesign) -> Float64Array:
    """Return light 0..1 encoded by the camera response, 0..1."""
    if camera.response == "gamma":
        return np.asarray(light ** (1.0 / camera.gamma))
    if camera.response == "srgb":
        bent = 1.055 * light ** (1.0 / 2.4) - 0.055
        return np.where(light <= 0.0031308, 12.92 * light, bent)
    return light


def exposed(
    signal: Float64Array, camera: CameraDesign, rng: np.random.Generator, *, averaged: int = 1
) -> PixelArray:
    """Return the pixel values for a signal.

    Shot noise has the variance ``shot_variance * signal``, read noise ``read_sd ** 2``; averaging
    frames divides both. Values above 1 saturate; the result is encoded and rounded.

    Parameters
    ----------
    signal : (rows, columns[, 3])
        Linear light, 1 is full scale.
    camera : CameraDesign
        Noise, response and bit depth.
    rng : Generator
        Source of the noise.
    averaged : int, optional
        Number of frames averaged.
    """
    full = float(2**camera.bit_depth - 1)
    variance = camera.shot_variance * np.maximum(signal, 0.0) + camera.read_sd**2
    noise = rng.standard_normal(signal.shape, dtype=np.float32)
    value = signal + noise * np.sqrt(variance / averaged)
    steps = np.rint(full * encoded(np.clip(value, 0.0, 1.0), camera))
    if camera.bit_depth == 8:
        return steps.astype(np.uint8)
    return steps.astype(np.uint16)
