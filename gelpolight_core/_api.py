"""The functions of the public interface, each a short path through the internal modules."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from inspect import getdoc
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.project import run_calibration as calibrate_session
from gelpolight_core.calibration.recipes import recipe_of, session_to_calibrate
from gelpolight_core.health.frame_health import refuse_meaningless
from gelpolight_core.measurement.map_reliability import with_map_findings
from gelpolight_core.measurement.object_measurement import AUTO, measure_heightmap
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.output.formats import HEIGHT_MAP_FORMATS
from gelpolight_core.output.heightmap_files import write_heightmap
from gelpolight_core.output.raster import read_npz
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.session.session_images import read_raw_image
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.simulated_session import simulate_session

AnyPath = str | PathLike[str]
StageProgressCallback = Callable[[str, float], None]


def simulate(
    folder: AnyPath,
    *,
    design: SensorDesign | None = None,
    seed: int = 0,
    scale: float = 1.0,
    closed: bool = False,
    progress: StageProgressCallback | None = None,
) -> Path:
    """Write a complete calibration session of the virtual sensor, with its truth.

    Parameters
    ----------
    folder : path
        Where to write it. It must not exist, or must be empty.
    design : SensorDesign, optional
        The sensor. The default is the sensor of the paper.
    seed : int, optional
        Seed of everything random: membrane texture, poses of the board, noise.
    scale : float, optional
        Image size relative to the design's. Lengths in mm do not change.
    closed : bool, optional
        Whether the sensor cannot be opened: background, balls, presses and the scale only.
    progress : callable, optional
        Called with the name of the present step and the share done (0 to 1).

    Returns
    -------
    Path
        The session folder.

    Raises
    ------
    InputError
        If the folder is not empty or cannot be written, or the design is impossible.

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> folder = gp.simulate("small-session", scale=0.1)
    >>> (folder / "session.toml").is_file()
    True
    """
    out = Path(folder)
    wanted = design or SensorDesign()
    simulate_session(wanted, out, seed=seed, scale=scale, closed=closed, progress=progress)
    return out


def calibrate(
    session: AnyPath, *, model: str | None = None, progress: StageProgressCallback | None = None
) -> Calibration:
    """Calibrate a sensor from its session folder.

    Parameters
    ----------
    session : path
        Folder with ``session.toml`` and one folder of images for each stage.
    model : {"full", "paper", "in-place"}, optional
        ``full``: near light, gloss, interreflection and shadows. ``paper``: the method of the
        paper, which is faster and less accurate. ``in-place``: a closed sensor, from background
        and balls alone. By default ``in-place`` for a closed sensor's session, else ``full``.
    progress : callable, optional
        Called with the name of the present stage and the share done (0 to 1).

    Returns
    -------
    Calibration
        Its `quality` holds the quality figures of each stage, `verdict` the worst of them.

    Raises
    ------
    InputError
        If a stage is missing or an image cannot be used. The message names the file.

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> calibration = gp.calibrate("session", model="paper")
    >>> calibration.model
    'paper'
    """
    checked = session_to_calibrate(Path(session))
    recipe = recipe_of(checked, model)
    return calibrate_session(checked, recipe, progress=progress).calibration


def read_image(path: AnyPath) -> NDArray[Any]:
    """Read an image as the camera encoded it.

    Parameters
    ----------
    path : path
        PNG, TIFF, BMP, JPEG or WebP, 8 or 16 bit.

    Returns
    -------
    (rows, columns, 3) uint8 or uint16
        RGB. A grey image gives three equal channels.

    Raises
    ------
    InputError
        If the file is missing or damaged, or is neither 8 nor 16 bit.

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> image = gp.read_image("session/background/background.png")
    >>> image.shape, image.dtype.name
    ((240, 320, 3), 'uint8')
    """
    return np.ascontiguousarray(read_raw_image(Path(path)).rgb)


def measure(
    height_map: HeightMap,
    *,
    shape: str = AUTO,
    at_mm: tuple[float, float] | None = None,
    edge_radius_mm: float | None = None,
) -> Measurement:
    """Measure the object that is pressed into the membrane.

    The shape is fitted together with the drape of the membrane around it.

    Parameters
    ----------
    height_map : HeightMap
        Result of `Reconstructor.depth`. With ``uncertainty=True``, the measurement states the part
        of the image's noise, `noise_sd`.
    shape : {"auto", "ball", "cylinder", "cuboid"}, optional
        What is pressed. ``auto`` fits all three and refuses an unclear result.
    at_mm : (float, float), optional
        A point (x, y) on the object, needed where several are pressed.
    edge_radius_mm : float, optional
        Stated fillet of the edge of a cylinder or cuboid. By default it is fitted, and the
        deviation of the sizes contains what the map does not show of it.

    Returns
    -------
    Measurement
        Sizes with their standard deviations, and a verdict.

    Raises
    ------
    InputError
        If the image has a fault that makes its depth meaningless, nothing is pressed, several
        objects are pressed and `at_mm` is not given, or the shape is unknown or unclear.

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> sensor = gp.Reconstructor(gp.read_calibration("sensor.gplcal"))
    >>> image = gp.read_image("session/presses/cylinder_s5_d100.png")
    >>> found = gp.measure(sensor.depth(image, uncertainty=True))
    >>> found.shape, round(found.diameter_mm)
    ('cylinder', 5)
    """
    if height_map.health is not None:
        refuse_meaningless(height_map.health, where=height_map.source or "height map")
    found = measure_heightmap(height_map, shape=shape, seed_mm=at_mm, edge_radius_mm=edge_radius_mm)
    return with_map_findings(found, height_map)


def read_height_map(path: AnyPath) -> HeightMap:
    """Read a height map that was written as ``npz``.

    The file holds no examples of the image's noise and no trace: `measure` then states larger
    standard deviations than for the map before it was written.

    Parameters
    ----------
    path : path
        The file.

    Raises
    ------
    InputError
        If the file is missing or damaged, or is not a height map.

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> sensor = gp.Reconstructor(gp.read_calibration("sensor.gplcal"))
    >>> image = gp.read_image("session/presses/cylinder_s5_d100.png")
    >>> (path,) = gp.write_height_map(sensor.depth(image, name="press.png"), "maps", formats="npz")
    >>> gp.read_height_map(path).source
    'press.png'
    """
    return read_npz(Path(path))


def write_height_map(
    height_map: HeightMap,
    folder: AnyPath,
    *,
    formats: Sequence[str] | str = ("npz",),
    stride: int = 1,
) -> list[Path]:
    """Write a height map as ``folder/<image name>.<format>``, one file for each format.

    The image name is the `name` that `Reconstructor.depth` was given; without it, all files are
    named ``heightmap``. A 16-bit PNG is named ``<image name>.depth.png``.

    Parameters
    ----------
    height_map : HeightMap
        Result of `Reconstructor.depth`.
    folder : path
        Made if it does not exist. Files of the same name are replaced.
    formats : sequence of str, or one of them, optional
        {formats}
        Heights and meshes are in the sensor frame (z = -depth on a flat membrane: a pressed-in ball
        leaves a pit), without the nodes outside the working area.
    stride : int, optional
        Meshes use every `stride`-th row and column.

    Returns
    -------
    list of Path
        The files, in the order of `formats`.

    Raises
    ------
    InputError
        If a format is unknown, a file cannot be written, or a mesh would be empty.

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> sensor = gp.Reconstructor(gp.read_calibration("sensor.gplcal"))
    >>> image = gp.read_image("session/presses/cylinder_s5_d100.png")
    >>> height_map = sensor.depth(image, name="cylinder.png")
    >>> [path.name for path in gp.write_height_map(height_map, "maps", formats=("npz", "ply"))]
    ['cylinder.npz', 'cylinder.ply']
    """
    return write_heightmap(height_map, Path(folder), formats=formats, stride=stride)


write_height_map.__doc__ = (getdoc(write_height_map) or "").replace(
    "{formats}",
    "\n    ".join(f"``{key}``: {row.title}." for key, row in HEIGHT_MAP_FORMATS.items()),
)
