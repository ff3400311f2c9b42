"""The last stage of an open sensor: the joint refinement."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

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
        *((f.name, f"{f.worth}; {f.values or 'left out'}") for f in term_facts(full)),
        ("Figures of terms", WORTH),
    )


WORTH = (
    "A term is needed if held-out presses are better with it, whatever its size. This is how far"
    " it changes the calculated light of the presses (rms), all else fitted again"
)
"""Which terms are needed, and the meaning of their figures."""


class TermFact(NamedTuple):
    """A term of the light with what it is worth, and its values; without them it is left out."""

    name: str
    worth: str
    values: str


def term_facts(full: FullModel) -> tuple[TermFact, ...]:
    """Return the terms that were tried, those that change the light most first."""
    from .refinement_parameters import TERMS

    membrane, sd = full.membrane, full.membrane_sd
    values = {
        "gloss": membrane.gloss,
        "roughness": membrane.roughness,
        "interreflection": membrane.interreflection,
        **membrane.terms,
    }
    tried = [term for term in TERMS if term.key in full.worth and term.parameters]
    facts = []
    for term in sorted(tried, key=lambda term: -full.worth[term.key]):
        percent = f"{100.0 * full.worth[term.key]:.1f} %"
        fitted = [
            f"{p.name} {values[p.full_key]:.3g} \N{PLUS-MINUS SIGN} {sd[p.full_key]:.2g}"
            for p in term.parameters
            if p.full_key in sd and p.full_key in values
        ]
        worth = "< 0.1 %" if percent == "0.0 %" else percent
        if term.parameters[0].full_key in sd and not fitted:
            fitted = [f"{len(term.parameters)} values"]
        facts.append(TermFact(term.name[0].upper() + term.name[1:], worth, "; ".join(fitted)))
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
