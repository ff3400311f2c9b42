"""A height map as one overview image: camera image, shaded depth, cross-section."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.drawing_thread import Figure, FigureCanvasAgg, LightSource, in_drawing_thread
from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.reconstruction.height_map import Flag, HeightMap

COLOURS = "viridis"


def preview_figure(heightmap: HeightMap, frame: NDArray[np.floating[Any]]) -> Figure:
    """Draw the camera image, the shaded depth with its scale, and a cross-section.

    The cross-section runs along x through the centre of the indentation.

    Parameters
    ----------
    heightmap : HeightMap
        The depth map.
    frame : (height, width, 3)
        The raw image, 0..1.
    """
    figure = Figure(figsize=(13.0, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    left, middle, right = figure.subplots(1, 3, width_ratios=(1.25, 1.2, 1.1))
    left.imshow(np.clip(frame, 0.0, 1.0) ** (1 / 2.2))
    left.set_title("Camera image")
    left.set_axis_off()
    depth = np.where(heightmap.flags & int(Flag.OUTSIDE), np.nan, heightmap.depth_mm)
    top = max(float(np.nanmax(depth)), 1e-3)
    _draw_depth(figure, middle, heightmap, depth, top)
    high = np.nan_to_num(depth) > 0.5 * top
    row = int(np.median(np.nonzero(high)[0])) if high.any() else depth.shape[0] // 2
    middle.axhline(heightmap.y_mm[row], color="white", linewidth=0.8, linestyle="--")
    right.plot(heightmap.x_mm, depth[row], linewidth=1.2)
    right.set_title(f"Section at y = {heightmap.y_mm[row]:.2f} mm")
    right.set_xlabel("x (mm)")
    right.set_ylabel("depth (mm)")
    right.set_ylim(-0.1 * top, 1.15 * top)
    right.grid(alpha=0.3)
    return figure


def _draw_depth(
    figure: Figure, axes: Any, heightmap: HeightMap, depth: NDArray[np.floating[Any]], top: float
) -> None:
    x, y = heightmap.x_mm, heightmap.y_mm
    extent = (float(x[0]), float(x[-1]), float(y[-1]), float(y[0]))
    image = axes.imshow(depth, extent=extent, cmap=COLOURS, vmin=0.0, vmax=top)
    light = LightSource(azdeg=315, altdeg=50)
    shade = light.hillshade(np.nan_to_num(depth), dx=heightmap.pitch_mm, dy=-heightmap.pitch_mm)
    shadow = np.zeros((*shade.shape, 4))
    shadow[..., 3] = np.where(np.isfinite(depth), np.clip(0.85 - shade, 0.0, 0.6), 0.0)
    axes.imshow(shadow, extent=extent)
    axes.set_title("Depth")
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("y (mm)")
    figure.colorbar(image, ax=axes, label="depth (mm)", shrink=0.9)


@in_drawing_thread
def write_preview(heightmap: HeightMap, frame: NDArray[np.floating[Any]], path: Path) -> None:
    """Write the preview as a PNG file, completely or not at all.

    Parameters
    ----------
    heightmap, frame
        As for :func:`preview_figure`.
    path : Path
        The file.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    figure = preview_figure(heightmap, frame)
    write_atomically(path, partial(figure.savefig, format="png", dpi=100))
