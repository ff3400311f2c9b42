"""The cause that explains most findings of a calibration, shown in place of their remedies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from .finding import QualityTable, Verdict


@dataclass(frozen=True, slots=True)
class Cause:
    """One mistake, and the findings that it moves.

    Attributes
    ----------
    key : str
        Name for scripts.
    remedy : str
        What to do about it, as a sentence without a full stop.
    moves : frozenset of str
        Keys of the findings.
    """

    key: str
    remedy: str
    moves: frozenset[str]


BALLS = ("lowest_cosine", "press_dirt_percent", "press_radius_percent")
HEIGHTS = ("ball_height_error_percent", "depth_sd_percent")
MODEL = ("scatter_percent", "factor_spread_percent", "gloss")
"""Light that no reflectance curve explains: it is fitted as gloss and as an uneven membrane."""
NAMING = (
    "squares_percent",
    "whiteboard_gap_percent",
    "background_light_percent",
    "background_place_percent",
    "stated_percent",
    "press_radius_percent",
    "interreflection_sd",
)
"""Findings that name their cause themselves, the first one first."""
JOINT = "stated_percent"
"""The joint refinement, which compares all causes at once: what it passes is innocent."""
OF_HEIGHTS = ("background_light_percent", "background_place_percent")
"""Their limits follow from the heights: where they only warn, they explain no failure."""
ALSO = ("balls_left_out", "depth_sd_percent", "joint_misfit_percent", "worst_press_ratio")
"""What follows from these, besides what others move."""
CAUSES = (
    Cause(
        "led_height",
        "Check the LED height",
        frozenset({*MODEL, "led_in_view", "led_outside_elastomer", "worst_misfit_percent"}),
    ),
    Cause(
        "refractive_index",
        "Check the refractive index of the elastomer",
        frozenset({*HEIGHTS, "stated_index", "contact_stretch_percent"}),
    ),
    Cause(
        "thickness",
        "Check the thickness of the elastomer",
        frozenset({*HEIGHTS, "led_outside_elastomer", "contact_stretch_percent"}),
    ),
    Cause(
        "ball_radius",
        "Check the diameters of the balls (session.toml holds their radii)",
        frozenset({*BALLS, *HEIGHTS, *MODEL}),
    ),
    Cause(
        "working_diameter",
        "Check the working diameter",
        frozenset({"field_over_view", "led_in_view", "whiteboard_unlit_percent"}),
    ),
    Cause(
        "square_size",
        "Check the square size of the board on the top surface",
        frozenset({*HEIGHTS, "field_over_view", "press_radius_percent", "reprojection_rms"}),
    ),
    Cause(
        "membrane",
        "The membrane is uneven: coat it again, or repeat the whiteboard stage",
        frozenset({"factor_spread_percent", "membrane_unusable_percent"}),
    ),
    Cause(
        "focus",
        "Focus the lens on the top surface, and calibrate again",
        frozenset({"blur", "edge_width", "reprojection_rms", "held_out_rms"}),
    ),
)


def best_cause(quality: Mapping[str, QualityTable]) -> Cause | None:
    """Return a calibration's most likely cause.

    A cause is the better, the more poor findings it moves, less the ones that it would move and
    that are not poor.

    Parameters
    ----------
    quality : mapping of str to QualityTable
        The quality figures of every stage.

    Returns
    -------
    Cause or None
        None if no cause explains two findings, or two causes explain them equally well. A finding
        that names its cause itself has its key and its remedy.
    """
    figures = [figure for table in quality.values() for figure in table.figures]
    remedies = {f.key: f.remedy for f in figures if f.verdict is not Verdict.PASS}
    poor = set(remedies)
    verdicts = {f.key: f.verdict for f in figures}
    fails = Verdict.FAIL in verdicts.values()
    for key in NAMING:
        is_minor = fails and key in OF_HEIGHTS and verdicts.get(key) is Verdict.WARN
        is_innocent = key == "press_radius_percent" and JOINT in verdicts
        if remedies.get(key) and not is_minor and not is_innocent:
            follow = frozenset().union(*(c.moves for c in CAUSES), ALSO) - {key}
            return Cause(key, remedies[key], follow)
    likely = sorted(
        (
            (2 * len(cause.moves & poor) - len(cause.moves), cause)
            for cause in CAUSES
            if len(cause.moves & poor) > 1
        ),
        key=lambda ranked: -ranked[0],
    )
    if not likely or (len(likely) > 1 and likely[0][0] == likely[1][0]):
        return None
    return likely[0][1]


def cause_and_rest(quality: Mapping[str, QualityTable]) -> tuple[str, dict[str, QualityTable]]:
    """Return the most likely cause of a calibration's findings, to be shown before them.

    Parameters
    ----------
    quality : mapping of str to QualityTable
        The quality figures of every stage.

    Returns
    -------
    cause : str
        As a sentence without a full stop; empty if there is none.
    quality : dict of str to QualityTable
        The tables; findings that follow from the cause have no remedy of their own.
    """
    cause = best_cause(quality)
    if cause is None:
        return "", dict(quality)
    tables = {
        stage: QualityTable(
            tuple(replace(f, remedy="") if f.key in cause.moves else f for f in table.figures)
        )
        for stage, table in quality.items()
    }
    return f"Most likely cause: {cause.remedy}", tables
