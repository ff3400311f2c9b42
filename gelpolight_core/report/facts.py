"""Facts of a calibration and of each stage of an open sensor, as labels and values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from gelpolight_core.reconstruction.in_place.calibration import MODEL as IN_PLACE
from gelpolight_core.reconstruction.in_place.calibration import ClosedSensor
from gelpolight_core.report.document import Facts
from gelpolight_core.report.labels import label
from gelpolight_core.sensor_calibration import MODELS, Calibration, FullModel, OpenSensor
from gelpolight_core.session.camera_controls import settings_facts
from gelpolight_core.translation import tr


def head_facts(c: Calibration) -> Facts:
    """Return sensor and provenance of a calibration."""
    p = c.provenance
    models = {"paper": tr("paper"), "full": tr("full"), "in-place": tr("in place, closed sensor")}
    edits = tuple(
        (
            tr("Edited by hand"),
            f"{label(edit.part)} ({', '.join(map(label, edit.channels))}), "
            f"{edit.made}, {edit.operator}".rstrip(", "),
        )
        for edit in p.edits
    )
    accepted = ((tr("Used although it failed"), p.accepted),) if p.accepted else ()
    return (
        (tr("Sensor"), c.serial),
        (tr("Calibration"), c.identity),
        (tr("Created"), f"{p.created.replace('T', ' ')}, {p.operator}".rstrip(", ")),
        (tr("Model"), models.get(c.model, c.model)),
        (tr("Session"), tr("{name} ({n} files)").format(name=p.session, n=len(p.sources))),
        (tr("Program"), f"GelPoLight Studio {p.program_version}"),
        (tr("Elastomer"), p.elastomer or tr("not stated")),
        *SENSOR_FACTS[c.model](c.data),
        *edits,
        *accepted,
        *settings_facts(p.camera_settings),
    )


def _open_facts(c: OpenSensor) -> Facts:
    s = c.sensor
    elastomer = f"{s.elastomer_thickness_mm:g} mm, n {s.elastomer_refractive_index:g}"
    window = f"{s.window_thickness_mm:g} mm, n {s.window_refractive_index:g}"
    return (
        (tr("Elastomer thickness"), elastomer),
        (tr("Window"), window if s.window_thickness_mm > 0.0 else tr("none")),
        (tr("LED height Z1"), f"{s.led_height_mm:g} mm"),
        (tr("Working diameter"), f"{s.working_diameter_mm:g} mm"),
    )


def _closed_facts(c: ClosedSensor) -> Facts:
    """Return the known and the unknown quantities of a closed sensor."""
    grid, errors = c.in_place.grid, c.in_place.errors
    error = tr("{share:.2g} % of it, and {floor:.2g} mm").format(
        share=100.0 * errors.depth_share, floor=errors.depth_floor_mm
    )
    scale = f"{grid.mm_per_px:.5f} mm/px \N{PLUS-MINUS SIGN} {100.0 * c.in_place.scale_sd:.2g} %"
    return (
        (tr("Image"), f"{c.camera.width} \N{MULTIPLICATION SIGN} {c.camera.height} px"),
        (tr("Scale"), scale),
        (tr("Error of a depth"), error),
        (tr("Not known"), tr("optics, refraction, temperature")),
    )


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


def stage_facts(calibration: Calibration) -> dict[str, Facts]:
    """Return the results of each stage as labels and values."""
    return STAGE_FACTS.get(calibration.model, lambda _data: {})(calibration.data)


def _open_stage_facts(c: OpenSensor) -> dict[str, Facts]:
    camera, plane, grid = c.camera, c.plane, c.table.grid
    tilt_deg = np.degrees(np.arccos(min(plane.normal_camera[2], 1.0)))
    nodes = tr("{columns} \N{MULTIPLICATION SIGN} {rows} nodes, {pitch:.2f} \N{MICRO SIGN}m")
    facts: dict[str, Facts] = {
        "lens": (
            (tr("Image"), f"{camera.width} \N{MULTIPLICATION SIGN} {camera.height} px"),
            (tr("Focal length fx, fy"), f"{camera.fx:.2f}, {camera.fy:.2f} px"),
            (tr("Principal point cx, cy"), f"{camera.cx:.2f}, {camera.cy:.2f} px"),
            (
                tr("Distortion k1, k2, p1, p2, k3"),
                ", ".join(f"{value:.5g}" for value in camera.distortion),
            ),
        ),
        "top_pose": (
            (tr("Distance from the optical centre"), f"{plane.distance_mm:.3f} mm"),
            (
                tr("Normal in the camera frame"),
                "({:.5f}, {:.5f}, {:.5f})".format(*plane.normal_camera),
            ),
            (tr("Tilt"), f"{tilt_deg:.3f}\N{DEGREE SIGN}"),
            (
                tr("Grid on the membrane"),
                nodes.format(columns=grid.shape[1], rows=grid.shape[0], pitch=1e3 * grid.pitch_mm),
            ),
        ),
    }
    return facts if c.full is None else facts | {"joint": _joint_facts(c.full)}


def _joint_facts(full: FullModel) -> Facts:
    membrane, (before, after) = full.membrane, full.held_out
    compared = before > 0.0  # otherwise no press was held out, and no loss measured
    kept = {
        "refined": tr("refined: they fit held-out presses better"),
        "mirror": tr("from the mirror: refinement did not improve held-out presses")
        if compared
        else tr("from the mirror: there were too few presses to leave any out"),
    }.get(full.kept, full.kept)
    loss = tr("{before:.3g} with the LEDs from the mirror, {after:.3g} refined")
    parameters = tr("gloss {a:.3f}, roughness {b:.3f}, interreflection {c:.3f}").format(
        a=membrane.gloss, b=membrane.roughness, c=membrane.interreflection
    )
    facts = (
        (tr("LEDs used"), kept),
        (tr("Membrane ({form})").format(form=label(full.membrane_kept)), parameters),
        (tr("Loss on held-out presses"), loss.format(before=before, after=after)),
    )
    return facts if compared else facts[:-1]


SENSOR_FACTS: Mapping[str, Callable[[Any], Facts]] = MappingProxyType(
    {**dict.fromkeys(MODELS, _open_facts), IN_PLACE: _closed_facts}
)
STAGE_FACTS: Mapping[str, Callable[[Any], dict[str, Facts]]] = MappingProxyType(
    dict.fromkeys(MODELS, _open_stage_facts)
)
