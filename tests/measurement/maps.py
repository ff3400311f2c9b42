"""Height maps with a known answer, for tests of the measuring tools."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import zoom

from gelpolight_core.measurement.result import Measurement
from gelpolight_core.reconstruction.height_map import Flag, HeightMap

Array = NDArray[np.float64]
PITCH = 0.05
X = np.arange(-8.0, 8.0, PITCH)
Y = np.arange(-6.0, 6.0, PITCH)


def made(surface: Callable[[Array, Array], Array] | Array, **more: object) -> HeightMap:
    """Return the map of a surface, given as depths or as a function of x and y; rim outside."""
    x, y = np.meshgrid(X, Y)
    depth = surface(x, y) if callable(surface) else surface
    flags = np.zeros(depth.shape, np.uint8)
    flags[:4] = flags[-4:] = int(Flag.OUTSIDE)
    return HeightMap(
        depth_mm=np.asarray(depth, np.float32),
        x_mm=X,
        y_mm=Y,
        pitch_mm=PITCH,
        normals=None,
        flags=flags,
        calibration_id="T-1",
        model="full",
        source="made.png",
        **more,  # type: ignore[arg-type]
    )


def on_grid(depth: Array, x: Array, y: Array, flags: NDArray[np.uint8] | None = None) -> HeightMap:
    """Return the map of depths on any grid."""
    flags = np.zeros(depth.shape, np.uint8) if flags is None else flags
    pitch = float(x[1] - x[0])
    return HeightMap(depth, x, y, pitch, None, flags, "T-1", "full", "made.png")


def measurement(shape: str, size: float, height: float) -> Measurement:
    """Return what a fit could have found."""
    sides = (size, size) if shape == "cuboid" else None
    sd = {"side_mm": (0.01, 0.01)} if sides else {"diameter_mm": 0.01}
    diameter, outline = None if sides else size, np.zeros((3, 2))
    return Measurement(shape, diameter, sides, height, (0.0, 0.0), None, 0.7,
                       sd | {"height_mm": 0.005}, 0.1, 0.02, 0.0, 0.003, outline)  # fmt: skip


def stated(count: int, sigma_mm: float, *, model_mm: float = 0.0) -> dict[str, object]:
    """Return noise that is even over blocks of four nodes, and what a map says of it."""
    shape = (Y.size, X.size)
    noise = np.random.default_rng(1).normal(0.0, sigma_mm, (count, Y.size // 4, X.size // 4))
    return {
        "noise_mm": noise.astype(np.float32),
        "depth_sd_mm": np.full(shape, sigma_mm, np.float32),
        "depth_model_sd_mm": np.full(shape, model_mm, np.float32),
        "slope_model_sd": np.zeros(shape, np.float32),
        "depth_scale_sd": 0.0,
        "lateral_scale_sd": 0.0,
    }


def drawn(sigma_mm: float, seed: int) -> Array:
    """Return another noise of the same kind, at full scale."""
    random = np.random.default_rng(seed)
    coarse = random.normal(0.0, sigma_mm, (Y.size // 4, X.size // 4))
    return np.asarray(zoom(coarse, 4, order=1, grid_mode=True, mode="nearest"))
