"""The last stage of an open sensor: the joint refinement."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .open_ball_stages import REFLECTANCE
from .open_sensor_recipe import led_facts
from .recipe import Facts, Stage, StageContext

if TYPE_CHECKING:
    from gelpolight_core.sensor.sensor_calibration import OpenSensor

    from .refinement_stage import RefinementStageResult


def _run_joint(work: StageContext) -> RefinementStageResult:
    from .refinement_stage import refine

    return refine(work)


def _joint_facts(c: OpenSensor) -> Facts:
    full = c.full
    if full is None:
        return ()
    membrane, (before, after) = full.membrane, full.held_out
    compared = before > 0.0  # otherwise no press was held out, and no loss measured
    leds_used = {
        "refined": "refined: they fit held-out presses better",
        "mirror": "from the mirror: refinement did not improve held-out presses"
        if compared
        else "from the mirror: there were too few presses to leave any out",
    }.get(full.kept, full.kept)
    loss = "{before:.3g} with the LEDs from the mirror, {after:.3g} refined"
    parameters = (
        f"gloss {membrane.gloss:.3f}, roughness {membrane.roughness:.3f}, "
        f"interreflection {membrane.interreflection:.3f}"
    )
    moved_mm = full.led_positions_mm - c.led_positions_mm
    shifts = ["{:+.3f}, {:+.3f}, {:+.3f} mm".format(*moved) for moved in moved_mm.tolist()]
    leds = led_facts(full.led_positions_mm, full.led_sd_mm)
    facts = (
        ("LEDs used", leds_used),
        *(
            (name, f"{led}, shifted by {shift}")
            for (name, led), shift in zip(leds, shifts, strict=True)
        ),
        (f"Membrane ({full.membrane_kept})", parameters),
        ("Loss on held-out presses", loss.format(before=before, after=after)),
    )
    return facts if compared else facts[:-1]


JOINT = Stage(
    "joint",
    "Joint refinement",
    _run_joint,
    (REFLECTANCE,),
    share=15,
    about="Fits LEDs, membrane and balls together to all ball presses",
    facts=_joint_facts,
)
