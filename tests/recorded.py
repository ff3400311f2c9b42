"""Recordings that tests write, of images that nobody else made."""

from pathlib import Path

import numpy as np

from gelpolight_core.base.arrays import PixelArray
from gelpolight_core.output.recording.recording_format import RecordingHeader
from gelpolight_core.output.recording.recording_writer import RecordingWriter


def noisy(number: int, shape: tuple[int, int] = (24, 32), kind: type = np.uint8) -> PixelArray:
    """Return a shaded image with noise that tells its number."""
    rng = np.random.default_rng(number)
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    even = 0.3 + 0.4 * rows[..., None] / shape[0] + 0.2 * columns[..., None] / shape[1]
    light = np.repeat(even, 3, axis=2) + rng.normal(0.0, 0.003, (*shape, 3))
    return np.asarray(np.rint(np.clip(light, 0.0, 1.0) * np.iinfo(kind).max), kind)


def write_recording(
    path: Path,
    *,
    frames: int = 3,
    rate_hz: float = 50.0,
    shape: tuple[int, int] = (24, 32),
    kind: type = np.uint8,
    header: RecordingHeader | None = None,
) -> list[PixelArray]:
    """Write a recording; return its images."""
    images = [noisy(number, shape, kind) for number in range(frames)]
    with RecordingWriter(path, header or RecordingHeader()) as writer:
        for number, rgb in enumerate(images):
            writer.append(rgb, number, 100.0 + number / rate_hz)
    return images
