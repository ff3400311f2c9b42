"""A calibrated sensor at any image size, with its presses.

A sensor is calibrated once, at the size of its session's images. Smaller images are averages over
pixels, with the calibration of that smaller camera. Only the pixel size changes from size to size,
not the calibration. Images that are larger than the session's are rendered, which only a virtual
sensor can.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.file import read_open_calibration, write_calibration
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.pipeline import assemble, stages_of
from gelpolight_core.calibration.refinement import bare_calibration, refine_with
from gelpolight_core.calibration.results import StageResults
from gelpolight_core.calibration.stages import run_stage
from gelpolight_core.errors import InputError
from gelpolight_core.experiments.rivals.samples import (
    BallSamples,
    ball_samples,
    read_samples,
    write_samples,
)
from gelpolight_core.io.atomic import make_folder
from gelpolight_core.lights.crosstalk import unmix
from gelpolight_core.measurement.score import TrueDepth, read_true_depth
from gelpolight_core.measurement.truth import read_truth
from gelpolight_core.optics.camera import Camera
from gelpolight_core.optics.resampling import MembraneGrid
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.session import Session
from gelpolight_core.translation import tr

Progress = Callable[[str, float], None]
Map = NDArray[np.float32]
FLAT_TOPPED = ("cylinder", "cuboid")
ROUNDING = 0.29 / 255.0
"""Standard deviation of rounding to eight bits."""


@dataclass(frozen=True, slots=True)
class Scene:
    """A calibrated sensor.

    Attributes
    ----------
    sensor : str
        Its name, for people.
    paper, full : Calibration
        By the paper's model, and refined.
    samples : BallSamples or None
        Training data of the rivals; None if only a calibration is known.
    kept : Path or None
        Folder for trained rivals.
    """

    sensor: str
    paper: Calibration
    full: Calibration
    samples: BallSamples | None = None
    kept: Path | None = None

    @property
    def background(self) -> Map:
        """The untouched membrane on the grid (rows, columns, 3), as the camera sees it."""
        full = self.full.full
        if full is None:
            raise InputError(
                tr("The calibration contains no background"),
                where=self.sensor,
                advice=tr("Calibrate for the full model"),
            )
        return np.asarray(full.background @ self.full.crosstalk.T, np.float32)


@dataclass(frozen=True, slots=True)
class Press:
    """A press with its image and its truth.

    Attributes
    ----------
    name : str
        The image's file.
    frame : (height, width, 3)
        Raw.
    truth : TrueDepth
        What was pressed.
    height_mm : float
        Of the plateau.
    """

    name: str
    frame: NDArray[Any]
    truth: TrueDepth
    height_mm: float


def calibrated_scene(session: Session, kept: Path, progress: Progress) -> Scene:
    """Calibrate a session, or read the result of an earlier run.

    Parameters
    ----------
    session : Session
        With all stages.
    kept : Path
        Folder of ``paper.gplcal``, ``full.gplcal`` and ``balls.npz``.
    progress : callable
        Called with the present task and the share done.

    Raises
    ------
    InputError
        If the session cannot be calibrated, or the folder cannot be written.
    """
    name = session.folder.resolve().name
    name = kept.name if name == "session" else name
    files = [kept / file for file in ("paper.gplcal", "full.gplcal", "balls.npz")]
    if not all(file.is_file() for file in files):
        make_folder(kept)
        results, stages = StageResults(), stages_of("paper")
        for number, stage in enumerate(stages):
            progress(stage.value, number / (len(stages) + 2))
            results = run_stage(stage, session, results)
        progress(Stage.JOINT.value, len(stages) / (len(stages) + 2))
        # This file is written last: if it exists, all others do.
        write_calibration(assemble(session, results, model="paper").calibration, files[0])
        write_calibration(bare_calibration(session, refine_with(session.sensor, results)), files[1])
        write_samples(ball_samples(results), files[2])
    progress("", 1.0)
    paper, full = (read_open_calibration(file) for file in files[:2])
    return Scene(name, paper, full, read_samples(files[2]), kept)


def session_presses(session: Session, names: Sequence[str] = ()) -> list[Press]:
    """Read the presses with a flat top, as camera values if these are linear.

    Parameters
    ----------
    session : Session
        With ``presses/truth.csv`` and ``truth/*.npz``.
    names : sequence of str, optional
        Only these files.

    Raises
    ------
    InputError
        If a press has no image or no truth, or there is none.
    """
    folder = session.folder / "presses"
    found = []
    for row in read_truth(folder / "truth.csv").rows:
        if row.truth.shape not in FLAT_TOPPED or (names and row.file not in names):
            continue
        truth = read_true_depth((session.folder / "truth" / row.file).with_suffix(".npz"))
        light = session.image(folder / row.file).rgb
        frame = np.rint(255.0 * light).astype(np.uint8)
        if not np.allclose(frame / np.float32(255.0), light, atol=1e-4):
            frame = light  # 16 bit, or not linear: linear light is kept as it is
        found.append(Press(row.file, frame, truth, row.truth.height_mm))
    if not found:
        raise InputError(
            tr("No press of a cylinder or cuboid was found"),
            where=str(folder / "truth.csv"),
            advice=tr("Use a session that contains such presses and their true depth"),
        )
    return found


def at_scale(scene: Scene, scale: float, background: Map) -> Scene:
    """Return the same sensor with a camera of `scale` times as many pixels per side.

    Parameters
    ----------
    scene : Scene
        Calibrated at another size.
    scale : float
        New size over old one.
    background : (height, width, 3) float32
        The untouched membrane at the new size, linear light.
    """
    return replace(
        scene,
        paper=_scaled(scene.paper, scale, background),
        full=_scaled(scene.full, scale, background),
    )


def smaller(frame: NDArray[Any], factor: int) -> NDArray[Any]:
    """Return an image averaged over blocks of `factor` x `factor` pixels, rounded as before."""
    if factor == 1:
        return frame
    height, width = (n // factor for n in frame.shape[:2])
    whole = np.asarray(frame[: height * factor, : width * factor], np.float32)
    mean = whole.reshape(height, factor, width, factor, 3).mean(axis=(1, 3))
    return np.asarray(np.rint(mean).astype(frame.dtype) if frame.dtype.kind != "f" else mean)


def _scaled(calibration: Calibration, scale: float, background: Map) -> Calibration:
    camera = _scaled_camera(calibration.camera, scale, background.shape[1], background.shape[0])
    old = calibration.table.grid
    bare = replace(calibration, camera=camera, bad=None)
    table = bare.table
    radiance, factors = (
        _on_grid(m, old, table.grid) for m in (calibration.radiance, calibration.factors)
    )
    light = table.apply(background)
    light[~table.valid] = 0.0
    clean = np.maximum(unmix(light, calibration.crosstalk), 0.0).astype(np.float32)
    full = calibration.full
    if full is not None:
        # The factors follow from the background (Eq. 9), so the new pixels change them, too.
        before = _on_grid(full.background, old, table.grid)
        share = np.divide(clean, before, out=np.ones_like(clean), where=before > 1e-3)
        factors = np.where(factors > 0.0, factors * share, 0.0).astype(np.float32)
        full = replace(full, background=clean)
    noise = np.hypot(calibration.noise * min(scale, 1.0), ROUNDING)
    return replace(bare, radiance=radiance, factors=factors, full=full, noise=noise, response=None)


def _scaled_camera(camera: Camera, scale: float, width: int, height: int) -> Camera:
    # Pixel centres have integer coordinates, so the corner of the image is at -0.5.
    return Camera(
        width,
        height,
        camera.fx * scale,
        camera.fy * scale,
        (camera.cx + 0.5) * scale - 0.5,
        (camera.cy + 0.5) * scale - 0.5,
        camera.distortion,
    )


def _on_grid(values: Map, old: MembraneGrid, new: MembraneGrid) -> Map:
    """Return a map (rows, columns, 3) on another grid, averaged if that is coarser.

    0 means unknown. Only known values are averaged, so that values do not decrease near the edge.
    """
    width = max(1, round(new.pitch_mm / old.pitch_mm))
    known = (values > 0.0).astype(np.float32)
    total, share = (cv2.blur(m, (width, width)) if width > 1 else m for m in (values, known))
    mean = np.divide(total, share, out=np.zeros_like(total), where=share > 0.0)
    x, y = np.meshgrid(
        (new.x_mm - old.x_mm[0]) / old.pitch_mm, (new.y_mm - old.y_mm[0]) / old.pitch_mm
    )
    at = x.astype(np.float32), y.astype(np.float32)
    seen = cv2.remap(mean, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    there = cv2.remap(known, *at, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    return np.where(there > 0.0, seen, 0.0).astype(np.float32)
