"""The last stage of an open sensor: the joint refinement."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .open_ball_stages import REFLECTANCE
from .open_sensor_recipe import led_facts
from .recipe import Facts, Stage, StageContext

if TYPE_CHECKING:
    from gelpolight_core.sensor.sensor_calibration import FullModel, OpenSensor

    from .refinement_stage import RefinementStageResult


def _run_joint(work: StageContext) -> RefinementStageResult:
    from .refinement_stage import refine

    return refine(work)


def _joint_facts(c: OpenSensor) -> Facts:
    full = c.full
    if full is None:
        return ()
    leds_used = {
        "refined": "refined: they fit held-out presses better",
        "mirror": "from the mirror: held-out presses do not ask for others",
    }.get(full.kept, full.kept)
    moved_mm = full.led_positions_mm - c.led_positions_mm
    shifts = ["{:+.3f}, {:+.3f}, {:+.3f} mm".format(*moved) for moved in moved_mm.tolist()]
    leds = led_facts(full.led_positions_mm, full.led_sd_mm)
    return (
        ("LEDs used", leds_used),
        *(
            (name, f"{led}, shifted by {shift}")
            for (name, led), shift in zip(leds, shifts, strict=True)
        ),
        *((name, text) for name, text, _ in term_facts(full)),
    )


def term_facts(full: FullModel) -> tuple[tuple[str, str, bool], ...]:
    """Return each term with its values and what it is worth, and whether it is needed."""
    from .refinement_parameters import TERMS

    membrane = full.membrane
    values = {
        "gloss": membrane.gloss,
        "roughness": membrane.roughness,
        "interreflection": membrane.interreflection,
        **membrane.terms,
    }
    facts = []
    for term in TERMS:
        if term.key not in full.evidence or not term.parameters:
            continue
        gain, scatter = full.evidence[term.key]
        change = "falls" if gain > 0.0 else "rises"
        size, sd = (f"{v:,.0f}" if abs(v) >= 100.0 else f"{v:.2g}" for v in (abs(gain), scatter))
        worth = f"chi square of held-out presses {change} by {size} (sd {sd})"
        fitted = [
            f"{p.name} {values[p.full_key]:.3g} (sd {full.membrane_sd[p.full_key]:.2g})"
            for p in term.parameters
            if p.full_key in full.membrane_sd and p.full_key in values
        ]
        is_needed = term.parameters[0].full_key in full.membrane_sd
        parts = (*fitted, worth) if is_needed else ("not clearly needed", worth)
        facts.append((term.name[0].upper() + term.name[1:], "; ".join(parts), is_needed))
    return tuple(facts)


JOINT = Stage(
    "joint",
    "Joint refinement",
    _run_joint,
    (REFLECTANCE,),
    stated=lambda s: (s.sensor.led_half_angle_deg, s.board_reflectance),
    share=15,
    about="Fits LEDs, membrane and balls together to all ball presses",
    facts=_joint_facts,
)
