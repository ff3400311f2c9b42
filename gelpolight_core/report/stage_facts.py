"""Descriptions and numbers of each stage for the report, from the calibration alone."""

from __future__ import annotations

import numpy as np

from gelpolight_core.channels import channel_name
from gelpolight_core.report.labels import label
from gelpolight_core.sensor_calibration import Calibration, FullModel
from gelpolight_core.translation import tr

Facts = tuple[tuple[str, str], ...]


def stage_intro(key: str) -> str:
    """Return the description of a stage, as a sentence without a full stop."""
    intros = {
        "lens": tr("Finds focal length, principal point and distortion from tilted checkerboards"),
        "top_pose": tr("Finds the top surface from a checkerboard that lies on it"),
        "lights": tr("Finds the LED positions from their reflections in a mirror"),
        "response": tr("Measures how pixel values depend on light, from several exposures"),
        "crosstalk": tr("Removes the light of each LED that the other channels see"),
        "radiance": tr("Measures the light of each LED on the membrane with a white diffuse board"),
        "reflectance": tr("Measures the reflectance of the membrane with balls of known radius"),
        "factors": tr(
            "Compares the brightness of the untouched membrane with the model, pixel by pixel"
        ),
        "joint": tr("Fits LEDs, membrane and balls together to all ball presses"),
        "scale": tr("Size of a camera pixel on the membrane, stated or measured"),
        "balls": tr("Finds the pressed balls, whose slopes are known"),
        "in_place": tr(
            "Fits the slope as a function of colour change and position. Each press "
            "is compared with the result of the other presses"
        ),
        "gel": tr("Keeps the slopes of an earlier gel with the background of this one"),
    }
    return intros.get(key, "")


def stage_facts(c: Calibration, key: str) -> Facts:
    """Return the results of a stage as labels and values."""
    if key == "lens":
        return _lens_facts(c)
    if key == "top_pose":
        return _plane_facts(c)
    if key == "lights":
        sd = np.sqrt(np.diagonal(c.led_covariance_mm2, axis1=1, axis2=2))
        return _led_facts(c.led_positions_mm, sd)
    if key == "crosstalk":
        return _crosstalk_facts(c)
    if key == "joint" and c.full is not None:
        return _joint_facts(c)
    return ()


def _lens_facts(c: Calibration) -> Facts:
    camera = c.camera
    return (
        (tr("Image"), f"{camera.width} \N{MULTIPLICATION SIGN} {camera.height} px"),
        (tr("Focal length fx, fy"), f"{camera.fx:.2f}, {camera.fy:.2f} px"),
        (tr("Principal point cx, cy"), f"{camera.cx:.2f}, {camera.cy:.2f} px"),
        (
            tr("Distortion k1, k2, p1, p2, k3"),
            ", ".join(f"{value:.5g}" for value in camera.distortion),
        ),
    )


def _plane_facts(c: Calibration) -> Facts:
    tilt = np.degrees(np.arccos(min(c.plane.normal_camera[2], 1.0)))
    grid = c.table.grid
    return (
        (tr("Distance from the optical centre"), f"{c.plane.distance_mm:.3f} mm"),
        (tr("Normal in the camera frame"), _vector(np.array(c.plane.normal_camera), 5)),
        (tr("Tilt"), f"{tilt:.3f}\N{DEGREE SIGN}"),
        (
            tr("Grid on the membrane"),
            tr(
                "{columns} \N{MULTIPLICATION SIGN} {rows} nodes, {pitch:.2f} \N{MICRO SIGN}m"
            ).format(columns=grid.shape[1], rows=grid.shape[0], pitch=1e3 * grid.pitch_mm),
        ),
    )


def _led_facts(leds_mm: np.ndarray, sd_mm: np.ndarray) -> Facts:
    return tuple(
        (
            tr("{name} LED x, y, z").format(name=channel_name(k).capitalize()),
            ", ".join(f"{x:.3f} \N{PLUS-MINUS SIGN} {s:.3f}" for x, s in zip(led, sd, strict=True))
            + " mm",
        )
        for k, (led, sd) in enumerate(zip(leds_mm, sd_mm, strict=True))
    )


def _crosstalk_facts(c: Calibration) -> Facts:
    off = c.crosstalk[~np.eye(3, dtype=bool)]
    return ((tr("Largest crosstalk between channels"), f"{100.0 * float(off.max()):.1f} %"),)


def _joint_facts(c: Calibration) -> Facts:
    assert c.full is not None
    m = c.full.membrane
    return (
        *_kept_facts(c.full),
        *_led_facts(c.full.led_positions_mm, c.full.led_sd_mm),
        *_loss_facts(c.full),
        (
            tr("Membrane ({form})").format(form=label(c.full.membrane_kept)),
            tr("gloss {a:.3f}, roughness {b:.3f}, interreflection {c:.3f}").format(
                a=m.gloss, b=m.roughness, c=m.interreflection
            ),
        ),
    )


def _kept_facts(full: FullModel) -> Facts:
    kept = {
        "refined": tr("refined: they fit held-out presses better"),
        "mirror": tr("from the mirror: refinement did not improve held-out presses"),
    }.get(full.kept, full.kept)
    if full.kept == "mirror" and not _held_out(full):
        kept = tr("from the mirror: there were too few presses to leave any out")
    return ((tr("LEDs used"), kept),)


def _loss_facts(full: FullModel) -> Facts:
    if not _held_out(full):
        return ()
    before, after = full.held_out
    text = tr("{before:.3g} with the LEDs from the mirror, {after:.3g} refined")
    return ((tr("Loss on held-out presses"), text.format(before=before, after=after)),)


def _held_out(full: FullModel) -> bool:
    """Return whether presses were held out; otherwise no loss was measured."""
    return full.held_out[0] > 0.0


def _vector(values: np.ndarray, digits: int) -> str:
    return "(" + ", ".join(f"{value:.{digits}f}" for value in values) + ")"
