"""Write a complete calibration session of the virtual sensor, with its truth."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

from gelpolight_core.base.atomic_write import make_folder, write_atomically, write_text
from gelpolight_core.base.errors import InputError, Remedy

from .board_scene import INNER_CORNERS, TOP_SQUARE_MM, VIEW_SQUARE_MM, BoardPose, board_views
from .design_parts import PressDesign
from .indenters import (
    BallIndenter,
    CuboidIndenter,
    CylinderIndenter,
    Indenter,
    coin,
    image_pitch_mm,
    nut,
    press_surface,
)
from .pressed_surface import PressedSurface
from .sensor_design import SensorDesign
from .session_plan import (
    AVERAGED,
    camera_table,
    exposure_series,
    half_angle_line,
    membrane_table,
    press_names,
    response_tables,
    session_stages,
)
from .simulation_kernel import Interrupt, never_interrupt
from .truth import truth_csv, truth_table
from .virtual_sensor import (
    BareMembrane,
    BoardOnTop,
    Checkerboard,
    Mirror,
    PressedMembrane,
    SensorState,
    VirtualSensor,
    Whiteboard,
)

StageProgressCallback = Callable[[str, float], None]

CLOSED_STAGES = ("background", "balls", "presses")
"""Image folders of a closed sensor's session; presses are for checking it."""
TRUTH_PITCH_MM = 0.05

_TEXTS = ("session.toml", "truth.json")
_BOARD_STAGES = ("checkerboard", "top_pose")


@dataclass(frozen=True, slots=True)
class _ImageSpec:
    """One image to simulate."""

    stage: str
    file: str
    make_state: Callable[[], SensorState]
    keeps_truth: bool = False


def simulate_session(
    design: SensorDesign,
    out: Path,
    *,
    seed: int = 0,
    scale: float = 1.0,
    presses_only: bool = False,
    closed: bool = False,
    progress: StageProgressCallback | None = None,
) -> None:
    """Write a session folder of the virtual sensor with ``truth.json`` and ``truth/*.npz``.

    The folder contains 16 checkerboard views, the board on the top surface, mirror, whiteboard,
    background, the balls and presses of the design, and the optional stages of its ``session``: the
    whiteboard at several exposures, and with a single LED on. The whiteboard fits only a flat
    membrane.

    Parameters
    ----------
    design : SensorDesign
        The sensor and its presses.
    out : Path
        Folder to create; it must not exist, or be empty.
    seed : int, optional
        Seed of the membrane's pattern, the board poses and the noise.
    scale : float, optional
        Relative size of the images; the geometry in mm stays.
    presses_only : bool, optional
        Whether only the presses are written, for a sensor that is already calibrated.
    closed : bool, optional
        Whether the sensor is closed: background, balls, presses and the scale only.
    progress : callable, optional
        Called with the last file written and the share done, 0..1; an exception raised by it stops
        the work.

    Raises
    ------
    InputError
        If the folder already contains files or cannot be written, or the parts of the design do not
        fit together; the folder is then left empty.
    """
    out = Path(out)
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError("The folder already contains files", out, Remedy.CHOOSE_FOLDER)
    sensor = VirtualSensor(design.scaled(scale), seed)
    is_new = not out.exists()
    stages = CLOSED_STAGES if closed else session_stages(design)
    folders = (*stages, "truth")
    for stage in folders:
        make_folder(out / stage)
    try:
        _write_texts(out, sensor, stages, closed)
        shots = (shot for shot in _shots(sensor) if shot.keeps_truth or not presses_only)
        _write_images(out, sensor, [shot for shot in shots if shot.stage in stages], progress)
    except BaseException:
        # An incomplete session is useless, and would block the next attempt.
        for stage in folders:
            shutil.rmtree(out / stage, ignore_errors=True)
        for text in _TEXTS:
            (out / text).unlink(missing_ok=True)
        if is_new:
            out.rmdir()
        raise


def _write_images(
    out: Path,
    sensor: VirtualSensor,
    shots: Sequence[_ImageSpec],
    progress: StageProgressCallback | None,
) -> None:
    with ThreadPoolExecutor(2) as pool:
        jobs = [(shot, pool.submit(_take, sensor, shot, out)) for shot in shots]
        try:
            for number, (shot, job) in enumerate(jobs, start=1):
                job.result()
                if progress is not None:
                    progress(f"{shot.stage}/{shot.file}", number / len(jobs))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _shots(sensor: VirtualSensor) -> Iterable[_ImageSpec]:
    design = sensor.design
    # The slowest first, so that the last image does not keep a single thread busy.
    for name, item in zip(press_names(design.presses), design.presses, strict=True):
        pressed = partial(
            pressed_membrane,
            design,
            indenter_of(item),
            x_mm=item.x_mm,
            y_mm=item.y_mm,
            yaw_deg=item.yaw_deg,
        )
        yield _ImageSpec("presses", f"{name}.png", pressed, keeps_truth=True)
    for number, ball in enumerate(design.balls):
        shape = BallIndenter(ball.radius_mm, ball.depth_mm)
        pressed = partial(pressed_membrane, design, shape, x_mm=ball.x_mm, y_mm=ball.y_mm)
        yield _ImageSpec("balls", f"ball_{number:02d}.png", pressed)
    for number, pose in enumerate(checkerboard_poses(design, sensor.seed)):
        state = Checkerboard(pose)
        yield _ImageSpec("checkerboard", f"view_{number:02d}.png", lambda state=state: state)  # type: ignore[misc]
    yield _ImageSpec("top_pose", "top_pose.png", BoardOnTop)
    yield _ImageSpec("mirror", "mirror.png", Mirror)
    yield _ImageSpec("whiteboard", "whiteboard.png", Whiteboard)
    yield _ImageSpec("background", "background.png", BareMembrane)
    for name, exposure in exposure_series(design).items():
        yield _ImageSpec("response", name, partial(Whiteboard, exposure=exposure))
    if design.session.single_led:
        for led, name in enumerate(("red", "green", "blue")):
            yield _ImageSpec("single_led", f"{name}.png", partial(Whiteboard, led=led))


def checkerboard_poses(design: SensorDesign, seed: int = 0) -> tuple[BoardPose, ...]:
    """Return the board poses in the lens views of a session.

    Parameters
    ----------
    design : SensorDesign
        With the camera.
    seed : int, optional
        Seed of the poses.
    """
    rng = np.random.default_rng([seed, 2])
    return board_views(design.camera, rng)


def indenter_of(item: PressDesign) -> Indenter:
    """Return the indenter for a press of a design."""
    if item.shape == "cylinder":
        return CylinderIndenter(item.size_mm, item.depth_mm, item.edge_radius_mm)
    if item.shape == "cuboid":
        return CuboidIndenter(item.size_mm, item.depth_mm, item.edge_radius_mm)
    return (coin if item.shape == "coin" else nut)(item.size_mm, item.depth_mm)


def pressed_membrane(
    design: SensorDesign,
    indenter: Indenter,
    *,
    x_mm: float,
    y_mm: float,
    yaw_deg: float = 0.0,
    interrupt: Interrupt = never_interrupt,
) -> PressedMembrane:
    """Return the sensor with an indenter in its membrane, as fine as its image requires.

    Parameters
    ----------
    design : SensorDesign
        The sensor.
    indenter : BallIndenter, CylinderIndenter, CuboidIndenter or ReliefIndenter
        The pressed object.
    x_mm, y_mm, yaw_deg : float
        Position and rotation.
    interrupt : callable, optional
        Called regularly; an exception raised by it stops the work.
    """
    return PressedMembrane(
        press_surface(
            indenter,
            x_mm=x_mm,
            y_mm=y_mm,
            yaw_deg=yaw_deg,
            decay_mm=design.membrane.decay_length_mm,
            rest=design.membrane,
            pitch_mm=image_pitch_mm(design),
            interrupt=interrupt,
        )
    )


def _take(sensor: VirtualSensor, shot: _ImageSpec, out: Path) -> None:
    state = shot.make_state()
    averaged = AVERAGED[shot.stage]
    frame = sensor.frame(state, averaged=averaged, stream=f"{shot.stage}/{shot.file}")
    image = frame[..., 0] if shot.stage in _BOARD_STAGES else frame[..., ::-1]
    path = out / shot.stage / shot.file
    done, data = cv2.imencode(".png", np.ascontiguousarray(image))
    if not done:
        raise RuntimeError(f"OpenCV could not encode {path}")
    write_atomically(path, lambda stream: stream.write(data.tobytes()))
    if shot.keeps_truth and isinstance(state, PressedMembrane):
        arrays = truth_grid(state.surface)
        write_atomically(
            out / "truth" / f"{path.stem}.npz",
            lambda stream: np.savez_compressed(stream, **arrays),
        )


def truth_grid(surface: PressedSurface) -> dict[str, Any]:
    """Return the arrays of a surface on the coarser grid of the truth."""
    step = TRUTH_PITCH_MM
    columns = np.arange(
        math.ceil(surface.x_mm[0] / step - 1e-9), math.floor(surface.x_mm[-1] / step + 1e-9) + 1
    )
    rows = np.arange(
        math.ceil(surface.y_mm[0] / step - 1e-9), math.floor(surface.y_mm[-1] / step + 1e-9) + 1
    )
    position = np.meshgrid(
        (rows * step - surface.y0_mm) / surface.pitch_mm,
        (columns * step - surface.x0_mm) / surface.pitch_mm,
        indexing="ij",
    )
    depth = map_coordinates(surface.depth_mm, position, order=1, mode="nearest")
    contact = map_coordinates(surface.contact.astype(np.float32), position, order=1, mode="nearest")
    return {
        "depth_mm": depth.astype(np.float32),
        "contact": contact > 0.5,
        "x0_mm": np.float64(columns[0] * step),
        "y0_mm": np.float64(rows[0] * step),
        "pitch_mm": np.float64(step),
    }


def _write_texts(out: Path, sensor: VirtualSensor, stages: Sequence[str], closed: bool) -> None:
    design = sensor.design
    description = closed_session_toml(sensor) if closed else session_toml(design)
    texts = (description, json.dumps(truth_table(sensor, stages), indent=1), truth_csv(design))
    for name, text in zip((*_TEXTS, "presses/truth.csv"), texts, strict=True):
        write_text(out / name, text)


def session_toml(design: SensorDesign) -> str:
    """Return the content of session.toml."""
    layers = design.layers
    balls = "\n".join(
        f'"ball_{number:02d}.png" = {ball.radius_mm!r}' for number, ball in enumerate(design.balls)
    )
    corners = list(INNER_CORNERS)
    return f"""format = "gelpolight-session"
version = 1

[sensor]
serial = {json.dumps(design.serial)}
led_height_mm = {design.ring.nominal_height_mm!r}
{half_angle_line(design)}elastomer_thickness_mm = {layers.elastomer_thickness_mm!r}
elastomer_refractive_index = {layers.elastomer_refractive_index!r}
window_thickness_mm = {layers.window_thickness_mm!r}
window_refractive_index = {layers.window_refractive_index!r}
working_diameter_mm = {design.membrane.working_diameter_mm!r}
{membrane_table(design)}
[checkerboard]
inner_corners = {corners}
square_mm = {VIEW_SQUARE_MM}

[top_pose]
inner_corners = {corners}
square_mm = {TOP_SQUARE_MM}

[balls.radius_mm]
{balls}
{response_tables(design)}"""


def mm_per_px(sensor: VirtualSensor) -> tuple[float, float]:
    """Return the mean and the standard deviation of a pixel's size on the membrane.

    Parameters
    ----------
    sensor : VirtualSensor
        Its rays know where each pixel sees the flat membrane.
    """
    rays = sensor.rays
    inside = np.hypot(rays.x_mm, rays.y_mm) < 0.5 * sensor.design.membrane.working_diameter_mm
    steps = np.stack(
        [
            np.hypot(np.gradient(rays.x_mm, axis=axis), np.gradient(rays.y_mm, axis=axis))
            for axis in (0, 1)
        ]
    )[:, inside]
    return float(steps.mean()), float(steps.std())


def closed_session_toml(sensor: VirtualSensor) -> str:
    """Return the content of session.toml of the closed sensor."""
    design = sensor.design
    scale, sd = mm_per_px(sensor)
    balls = "\n".join(
        f'"ball_{number:02d}.png" = {ball.radius_mm!r}' for number, ball in enumerate(design.balls)
    )
    return f"""format = "gelpolight-session"
version = 1

[sensor]
serial = {json.dumps(design.serial)}

[in_place]
mm_per_px = {scale:.7f}
mm_per_px_sd = {sd:.7f}

[balls.radius_mm]
{balls}
{camera_table(design)}"""
