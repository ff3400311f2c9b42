"""Facts of a calibration and of each of its stages, as labels and values."""

from __future__ import annotations

from gelpolight_core.calibration.recipe import Facts
from gelpolight_core.calibration.recipes import recipe_named
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.session.camera_controls import settings_facts


def head_facts(c: Calibration) -> Facts:
    """Return sensor and provenance of a calibration."""
    p = c.provenance
    recipe = recipe_named(c.model)
    edits = tuple(
        (
            "Edited by hand",
            f"{edit.part} ({', '.join(edit.channels)}), {edit.made}, {edit.operator}".rstrip(", "),
        )
        for edit in p.edits
    )
    accepted = (("Used although it failed", p.accepted),) if p.accepted else ()
    return (
        ("Sensor", c.serial),
        ("Calibration", c.identity),
        ("Created", f"{p.created.replace('T', ' ')}, {p.operator}".rstrip(", ")),
        ("Model", recipe.title),
        ("Session", f"{p.session} ({len(p.sources)} files)"),
        ("Program", f"GelPoLight Studio {p.program_version}"),
        *recipe.facts(c.data),
        *edits,
        *accepted,
        *settings_facts(p.camera_settings),
    )


def stage_facts(c: Calibration) -> dict[str, Facts]:
    """Return the results of each stage as labels and values, by the keys of its tables."""
    return {key: table.facts(c.data) for key, table in recipe_named(c.model).tables.items()}
