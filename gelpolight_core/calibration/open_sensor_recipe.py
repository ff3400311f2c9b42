"""The stages of a sensor that can be opened, in the order in which light travels.

``open_ball_stages.py`` has the stages of the ball presses.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding, QualityTable, join_quality_tables, judge

from .recipe import Facts, QualityTableSpec, Stage, StageContext, StageResults

if TYPE_CHECKING:
    from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
    from gelpolight_core.geometry.resampling import ResamplingTable
    from gelpolight_core.image.bad_pixels import BadPixels
    from gelpolight_core.image.linear_image import LinearImage
    from gelpolight_core.sensor.sensor_calibration import OpenSensor
    from gelpolight_core.session.session import Session
    from gelpolight_core.stages.camera_response.response_stage import ResponseResult
    from gelpolight_core.stages.checkerboards.lens import LensResult
    from gelpolight_core.stages.checkerboards.top_surface_pose import TopPoseResult
    from gelpolight_core.stages.flat_field.whiteboard_stage import LightIntensityResult
    from gelpolight_core.stages.leds.crosstalk import CrosstalkResult
    from gelpolight_core.stages.leds.led_positions import LedPositionsResult


@dataclass(frozen=True, slots=True)
class TopSurfaceStageResult:
    """Pose of the top surface, and the table from image to membrane that follows from it."""

    pose: TopPoseResult
    table: ResamplingTable

    @property
    def quality(self) -> QualityTable:
        """Figures of the pose."""
        return self.pose.quality


@dataclass(frozen=True, slots=True)
class LedsStageResult:
    """LED positions and crosstalk."""

    leds: LedPositionsResult
    crosstalk: CrosstalkResult

    @property
    def quality(self) -> QualityTable:
        """Figures of both."""
        return join_quality_tables((self.leds.quality, self.crosstalk.quality))


@dataclass(frozen=True, slots=True)
class BackgroundStageResult:
    """The untouched membrane.

    Attributes
    ----------
    light : (rows, columns, 3) float32
        Its light, resampled onto the grid.
    bad : BadPixels
        Pixels of the camera that do not follow the light.
    quality : QualityTable
        Figures of both.
    table : ResamplingTable
        From image to membrane; of a curved one, with its axis in the middle of the circle.
    radiance : LightIntensityResult
        Light intensity on it; of a curved membrane by the positions of the LEDs.
    suspect : (rows / 4, columns / 4) bool
        Areas of its image that something touches, or that have another coating.
    """

    light: Float32Array
    bad: BadPixels
    quality: QualityTable
    table: ResamplingTable
    radiance: LightIntensityResult
    suspect: BoolArray


def with_response(session: Session, results: StageResults) -> Session:
    """Return the session with the camera response as the first stage found it."""
    return replace(session, response=results[RESPONSE].response)


def stage_image(work: StageContext, folder: str) -> LinearImage:
    """Return the average image of a stage with one view, in colour and of the lens views' size."""
    from .image_checks import require_lit_colours

    image = with_response(work.session, work.results).averaged(folder)
    require_lit_colours(image, work.session, where=f"{folder}/{image.name}")
    same_size(image, work[LENS], folder)
    return image


def same_size(image: LinearImage, lens: LensResult, folder: str) -> None:
    """Refuse an image that has another size than the lens views."""
    from gelpolight_core.image.linear_image import require_size

    size = lens.camera.width, lens.camera.height
    require_size(image.size, size, where=f"{folder}/{image.name}")


def _run_response(work: StageContext) -> ResponseResult:
    from gelpolight_core.stages.camera_response.response_stage import (
        declare_response,
        measure_response,
    )

    session = work.session
    if "response" in session.optional_stages:
        return measure_response(*session.series(), declared=session.declared_response)
    return declare_response(session.declared_response)


def _response_facts(c: OpenSensor) -> Facts:
    text = "linear"
    if c.response is not None:
        text = f"up to {100.0 * c.response.departure:.1f} % of full scale from linear"
    return (("Camera response", text),)


def _response_entries(results: StageResults) -> dict[str, Any]:
    result = results[RESPONSE]
    curves = None if result.response is None else result.response.curves.tolist()
    entries = {"source": result.source, "linear": curves is None, "light_of_even_values": curves}
    return {"response": entries}


RESPONSE = Stage(
    "response",
    "Camera response",
    _run_response,
    optional=lambda _session: ("response",),
    stated=lambda s: (s.declared_response, sorted(s.exposures_ms.items())),
    share=2,
    about="Measures how pixel values depend on light, from several exposures",
    facts=_response_facts,
    entries=_response_entries,
    lines=lambda found: (f"camera response: {found.summary}",),
)


def _run_lens(work: StageContext) -> LensResult:
    from gelpolight_core.stages.checkerboards.lens import calibrate_lens

    images, refused = with_response(work.session, work.results).usable_images(LENS.folder)
    return calibrate_lens(images, work.session.checkerboard, refused=refused)


def _lens_facts(c: OpenSensor) -> Facts:
    camera = c.camera
    distortion = ", ".join(f"{value:.5g}" for value in camera.distortion)
    return (
        ("Image", f"{camera.width} \N{MULTIPLICATION SIGN} {camera.height} px"),
        ("Focal length fx, fy", f"{camera.fx:.2f}, {camera.fy:.2f} px"),
        ("Principal point cx, cy", f"{camera.cx:.2f}, {camera.cy:.2f} px"),
        ("Distortion k1, k2, p1, p2, k3", distortion),
    )


def _lens_entries(results: StageResults) -> dict[str, Any]:
    camera = results[LENS].camera
    numbers = {key: getattr(camera, key) for key in ("fx", "fy", "cx", "cy")}
    return {"camera": {**numbers, "distortion_k1_k2_p1_p2_k3": list(camera.distortion)}}


LENS = Stage(
    "lens",
    "Lens",
    _run_lens,
    (RESPONSE,),
    "checkerboard",
    "view",
    stated=lambda s: s.checkerboard,
    share=28,
    about="Finds focal length, principal point and distortion from tilted checkerboards",
    facts=_lens_facts,
    entries=_lens_entries,
)


def _run_top_pose(work: StageContext) -> TopSurfaceStageResult:
    from gelpolight_core.geometry.resampling import build_resampling_table
    from gelpolight_core.sensor.sensor_calibration import sensor_stack
    from gelpolight_core.stages.checkerboards.top_surface_pose import estimate_top_pose

    lens, session = work[LENS], with_response(work.session, work.results)
    images, refused = session.usable_images(TOP_POSE.folder)
    pose = estimate_top_pose(
        images,
        session.top_pose,
        lens.camera,
        focal_sd_px=float(lens.sd[0]),
        refused=refused,
    )
    table = build_resampling_table(
        lens.camera,
        pose.plane,
        sensor_stack(session.sensor, pose.plane),
        working_diameter_mm=session.sensor.working_diameter_mm,
        surface=session.surface,
    )
    return TopSurfaceStageResult(pose, table)


def _top_pose_facts(c: OpenSensor) -> Facts:
    plane, grid = c.plane, c.table.grid
    tilt_deg = np.degrees(np.arccos(min(plane.normal_camera[2], 1.0)))
    rows, columns = grid.shape
    nodes = f"{columns} \N{MULTIPLICATION SIGN} {rows} nodes"
    normal = "({:.5f}, {:.5f}, {:.5f})".format(*plane.normal_camera)
    return (
        ("Distance from the optical centre", f"{plane.distance_mm:.3f} mm"),
        ("Normal in the camera frame", normal),
        ("Tilt", f"{tilt_deg:.3f}\N{DEGREE SIGN}"),
        ("Grid on the membrane", f"{nodes}, {1e3 * grid.pitch_mm:.2f} \N{MICRO SIGN}m"),
    )


def _top_pose_entries(results: StageResults) -> dict[str, Any]:
    plane = results[TOP_POSE].pose.plane
    normal = list(plane.normal_camera)
    return {"top_plane": {"normal_camera": normal, "distance_mm": plane.distance_mm}}


TOP_POSE = Stage(
    "top_pose",
    "Top surface",
    _run_top_pose,
    (LENS,),
    "top_pose",
    "top",
    stated=lambda s: (
        s.top_pose,
        s.sensor.elastomer_thickness_mm,
        s.sensor.elastomer_refractive_index,
        s.sensor.window_thickness_mm,
        s.sensor.window_refractive_index,
        s.sensor.working_diameter_mm,
        s.surface,
    ),
    share=10,
    about="Finds the top surface from a checkerboard that lies on it",
    facts=_top_pose_facts,
    entries=_top_pose_entries,
)


def _run_lights(work: StageContext) -> LedsStageResult:
    from gelpolight_core.stages.leds.crosstalk import find_crosstalk
    from gelpolight_core.stages.leds.led_positions import locate_leds
    from gelpolight_core.stages.leds.mirror_spots import find_mirror_spots
    from gelpolight_core.stages.leds.setup_checks import judge_set_up, judge_set_up_by_pose

    session, pose = work.session, work[TOP_POSE].pose
    image = stage_image(work, LIGHTS.folder)
    spots = find_mirror_spots(image, placed=session.decisions.spots_px)
    leds = locate_leds(
        spots,
        work[LENS].camera,
        pose.plane,
        led_height_mm=session.sensor.led_height_mm,
        plane_distance_sd_mm=pose.distance_sd_mm,
        plane_normal_sd_rad=float(np.radians(pose.normal_sd_deg)),
    )
    poor = (
        *judge_set_up(session.sensor),
        *judge_set_up_by_pose(session.sensor, work[LENS].camera, pose.plane, leds.led_positions_mm),
    )
    leds = replace(leds, quality=QualityTable((*leds.quality.figures, *poor)))
    return LedsStageResult(leds, find_crosstalk(spots, _single_led(work)))


def _single_led(work: StageContext) -> tuple[LinearImage, ...]:
    from gelpolight_core.session.session_images import require_colour

    if "single_led" not in work.session.optional_stages:
        return ()
    images = with_response(work.session, work.results).single_led()
    for image in images:
        require_colour(image, where=f"single_led/{image.name}")
    same_size(images[0], work[LENS], "single_led")
    return images


def led_facts(leds_mm: Float64Array, sd_mm: Float64Array) -> Facts:
    """Return the position of each LED, (3, 3) in the sensor frame, with standard deviations."""
    lines = [
        ", ".join(f"{x:.3f} \N{PLUS-MINUS SIGN} {s:.3f}" for x, s in zip(led, sd, strict=True))
        for led, sd in zip(leds_mm, sd_mm, strict=True)
    ]
    return tuple((f"{CHANNEL_KEYS[k]} LED", f"{line} mm") for k, line in enumerate(lines))


def _sd_mm(covariance_mm2: Float64Array) -> Float64Array:
    return np.asarray(np.sqrt(np.diagonal(covariance_mm2, axis1=1, axis2=2)))


def _light_entries(results: StageResults) -> dict[str, Any]:
    leds, crosstalk = results[LIGHTS].leds, results[LIGHTS].crosstalk
    positions_mm = leds.led_positions_mm
    camera_mm = results[TOP_POSE].pose.plane.to_camera(positions_mm)
    return {
        "mirror_spots_px": leds.spots.centres_px.tolist(),
        "led_positions_mm": positions_mm.tolist(),
        "led_positions_camera_mm": camera_mm.tolist(),
        "led_sd_mm": _sd_mm(leds.led_covariance_mm2).tolist(),
        "crosstalk": crosstalk.matrix.tolist(),
        "crosstalk_source": crosstalk.source,
    }


LIGHTS = Stage(
    "lights",
    "Lights",
    _run_lights,
    (TOP_POSE,),
    "mirror",
    optional=lambda _session: ("single_led",),
    stated=lambda s: (s.sensor.led_height_mm, sorted(s.decisions.spots_px.items())),
    share=5,
    one_image=True,
    colour=True,
    tables=(
        QualityTableSpec(
            "lights",
            "Lights",
            lambda lights: lights.leds.quality,
            "Finds the LED positions from their reflections in a mirror",
            lambda c: led_facts(c.led_positions_mm, _sd_mm(c.led_covariance_mm2)),
        ),
        QualityTableSpec(
            "crosstalk",
            "Crosstalk",
            lambda lights: lights.crosstalk.quality,
            "Removes the light of each LED that the other channels see",
        ),
    ),
    entries=_light_entries,
)


def _run_radiance(work: StageContext) -> LightIntensityResult:
    from gelpolight_core.stages.flat_field.whiteboard_stage import calibrate_radiance

    leds_mm = work[LIGHTS].leds.led_positions_mm
    return calibrate_radiance(
        stage_image(work, RADIANCE.folder),
        work[TOP_POSE].table,
        leds_mm,
        elastomer_index=work.session.sensor.elastomer_refractive_index,
    )


RADIANCE = Stage(
    "radiance",
    "Light intensity",
    _run_radiance,
    (LIGHTS,),
    "whiteboard",
    used=lambda s: s.surface.flat,
    share=3,
    one_image=True,
    colour=True,
    lit=True,
    about="Measures the light of each LED on the membrane with a white diffuse board",
)


def _run_background(work: StageContext) -> BackgroundStageResult:
    from gelpolight_core.image.bad_pixels import find_bad_pixels, no_bad_pixels
    from gelpolight_core.stages.flat_field.bare_membrane_check import check_bare_membrane
    from gelpolight_core.stages.flat_field.whiteboard_stage import radiance_by_positions

    table, image = work[TOP_POSE].table, stage_image(work, BACKGROUND.folder)
    _refuse_unlit(image)
    # As encoded by the camera, like the live hint.
    raw, board = replace(work.session, response=None), RADIANCE.folder
    has_board = RADIANCE.used(work.session)
    whiteboard = raw.averaged(board).rgb if has_board and raw.found(board) else None
    encoded = raw.averaged(BACKGROUND.folder).rgb
    bare_check = check_bare_membrane(encoded, table=table, whiteboard=whiteboard)
    bad = no_bad_pixels(*image.rgb.shape[:2])
    if whiteboard is not None and whiteboard.shape == image.rgb.shape:
        lit = with_response(work.session, work.results).averaged(board).rgb
        bad = find_bad_pixels([image.rgb, lit])
    figures = (*bare_check.quality.figures, _judge_bad_pixels(bad))
    whole = bad.fill_bad_pixels(image.rgb)
    if has_board:
        return BackgroundStageResult(
            table.apply(whole),
            bad,
            QualityTable(figures),
            table,
            work[RADIANCE],
            bare_check.pressed,
        )
    table, axis_quality = _table_about_axis(work, whole)
    light = table.apply(whole)
    radiance = radiance_by_positions(light, table, work[LIGHTS].leds.led_positions_mm)
    quality = QualityTable((*figures, *axis_quality.figures))
    return BackgroundStageResult(light, bad, quality, table, radiance, bare_check.pressed)


def _table_about_axis(
    work: StageContext, image: Float32Array
) -> tuple[ResamplingTable, QualityTable]:
    """Return the table of a curved membrane about its axis, as the background shows it."""
    from gelpolight_core.geometry.resampling import build_resampling_table
    from gelpolight_core.sensor.sensor_calibration import sensor_stack
    from gelpolight_core.stages.flat_field.boundary_circle import centre_on_boundary

    sensor, camera, plane = work.session.sensor, work[LENS].camera, work[TOP_POSE].pose.plane
    optics = camera, plane, sensor_stack(sensor, plane)
    surface, axis_quality = centre_on_boundary(work.session.surface, image, *optics)
    table = build_resampling_table(
        *optics, working_diameter_mm=sensor.working_diameter_mm, surface=surface
    )
    return table, axis_quality


def _judge_bad_pixels(bad: BadPixels) -> Finding:
    """Judge how many pixels of the camera do not follow the light."""
    from gelpolight_core.image.bad_pixels import FAR_SHARE

    return judge(
        "bad_pixels_percent",
        "Dead and hot pixels, left out",
        100.0 * len(bad.pixels) / max(bad.height * bad.width, 1),
        "%",
        warn=0.5,
        fail=100.0 * FAR_SHARE,
        remedy="Replace the camera, or lower its gain and temperature",
    )


def _refuse_unlit(image: LinearImage) -> None:
    from gelpolight_core.base.membrane_masks import saturated_mask

    brightest = np.percentile(image.rgb, 99.5, axis=(0, 1))
    if brightest.min() < 0.05:
        text = f"The image is dark (a channel only reaches {brightest.min():.1%})"
        raise InputError(text, f"background/{image.name}", Remedy.LIGHT_ON)
    share = float(saturated_mask(image.rgb).any(axis=2).mean())
    if share > 0.2:
        text = f"{share:.0%} of the image is saturated"
        raise InputError(text, f"background/{image.name}", Remedy.SHORTER_EXPOSURE)


BACKGROUND = Stage(
    "background",
    "Background",
    _run_background,
    (LIGHTS, RADIANCE),
    "background",
    share=2,
    one_image=True,
    colour=True,
    lit=True,
)
