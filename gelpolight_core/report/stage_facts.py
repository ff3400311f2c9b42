"""What the report says of each stage in words and numbers, from the calibration alone."""

from __future__ import annotations

import numpy as np

from gelpolight_core.calibration.calibration import Calibration, FullModel
from gelpolight_core.report.drawing import CHANNELS
from gelpolight_core.translation import tr

Facts = tuple[tuple[str, str], ...]
INTROS = {
    "lens": "Checkerboard views at several tilts give focal length, principal point and distortion",
    "top_pose": "A checkerboard on the top surface says where that surface is",
    "lights": "A mirror on the top surface shows each LED; the ray back gives its position",
    "response": "One scene at several exposures shows how the camera's numbers follow the light",
    "crosstalk": "Each LED's light is seen by the other channels too; that share is taken away",
    "radiance": "A white diffuse board measures the light that each LED sends to the membrane",
    "reflectance": "Balls of known radius show the membrane at known angles to the light",
    "factors": "The bare membrane against theory: where it reflects more or less than on average",
    "joint": "LEDs, membrane and balls are fitted together to what all ball presses show",
}


def stage_intro(key: str) -> str:
    """Return what a stage does, as a clause without a full stop."""
    return tr(INTROS[key]) if key in INTROS else ""


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
        (tr("Picture"), f"{camera.width} \N{MULTIPLICATION SIGN} {camera.height} px"),
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
            tr("{name} LED x, y, z").format(name=tr(name).capitalize()),
            ", ".join(f"{x:.3f} \N{PLUS-MINUS SIGN} {s:.3f}" for x, s in zip(led, sd, strict=True))
            + " mm",
        )
        for name, led, sd in zip(CHANNELS, leds_mm, sd_mm, strict=True)
    )


def _crosstalk_facts(c: Calibration) -> Facts:
    off = c.crosstalk[~np.eye(3, dtype=bool)]
    return ((tr("Crosstalk between channels, most"), f"{100.0 * float(off.max()):.1f} %"),)


def _joint_facts(c: Calibration) -> Facts:
    assert c.full is not None
    m = c.full.membrane
    return (
        *_kept_facts(c.full),
        *_led_facts(c.full.led_positions_mm, c.full.led_sd_mm),
        *_loss_facts(c.full),
        (
            tr("Membrane ({form})").format(form=tr(c.full.membrane_kept)),
            tr(
                "gloss {gloss:.3f}, roughness {roughness:.3f}, light from around {bounce:.3f}"
            ).format(gloss=m.gloss, roughness=m.roughness, bounce=m.bounce),
        ),
    )


def _kept_facts(full: FullModel) -> Facts:
    kept = {
        "refined": tr("the refined ones: they explain held-out presses better"),
        "mirror": tr("the mirror's: refining them did not help on held-out presses"),
    }.get(full.kept, full.kept)
    if full.kept == "mirror" and not _held_out(full):
        kept = tr("the mirror's: there were too few presses to hold any out")
    return ((tr("LEDs that are used"), kept),)


def _loss_facts(full: FullModel) -> Facts:
    if not _held_out(full):
        return ()
    before, after = full.held_out
    text = tr("{before:.3g} with the mirror's LEDs, {after:.3g} refined")
    return ((tr("Loss on held-out presses"), text.format(before=before, after=after)),)


def _held_out(full: FullModel) -> bool:
    """Return whether presses were held out: without any, no loss was measured."""
    return full.held_out[0] > 0.0


def _vector(values: np.ndarray, digits: int) -> str:
    return "(" + ", ".join(f"{value:.{digits}f}" for value in values) + ")"
