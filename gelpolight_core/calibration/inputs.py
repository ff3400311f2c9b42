"""The inputs of each stage of a calibration, to find out which results are out of date."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType

from gelpolight_core.session.file_hashes import file_hash
from gelpolight_core.session.session import Session
from gelpolight_core.translation import tr


class Stage(StrEnum):
    """A stage, in calibration order."""

    RESPONSE = "response"
    LENS = "lens"
    TOP_POSE = "top_pose"
    LIGHTS = "lights"
    RADIANCE = "radiance"
    BACKGROUND = "background"
    SCALE = "scale"
    BALLS = "balls"
    REFLECTANCE = "reflectance"
    JOINT = "joint"


FOLDERS = MappingProxyType(
    {
        Stage.LENS: "checkerboard",
        Stage.TOP_POSE: "top_pose",
        Stage.LIGHTS: "mirror",
        Stage.RADIANCE: "whiteboard",
        Stage.BACKGROUND: "background",
        Stage.SCALE: "scale",
        Stage.BALLS: "balls",
    }
)
"""Image folder of each stage that has images of its own."""

OPTIONAL_FOLDERS = MappingProxyType({Stage.RESPONSE: "response", Stage.LIGHTS: "single_led"})
"""Folders of additional images that a stage uses if a session has them."""

NEEDS = MappingProxyType(
    {
        Stage.RESPONSE: (),
        Stage.LENS: (Stage.RESPONSE,),
        Stage.TOP_POSE: (Stage.LENS,),
        Stage.LIGHTS: (Stage.TOP_POSE,),
        Stage.RADIANCE: (Stage.LIGHTS,),
        Stage.BACKGROUND: (Stage.RADIANCE,),
        Stage.BALLS: (Stage.BACKGROUND,),
        Stage.REFLECTANCE: (Stage.BALLS,),
        Stage.JOINT: (Stage.REFLECTANCE,),
    }
)
"""The stages of an open sensor, and those whose results a stage uses directly."""


@dataclass(frozen=True, slots=True)
class StageInputs:
    """All inputs of a stage's result.

    Attributes
    ----------
    images : tuple of (name, SHA-256)
        Its own images, without excluded ones.
    stated : str
        Stated values and decisions that it uses.
    earlier : tuple of str
        Fingerprints of the stages that it needs.
    """

    images: tuple[tuple[str, str], ...]
    stated: str
    earlier: tuple[str, ...]

    @property
    def fingerprint(self) -> str:
        """A text that changes with any of the inputs."""
        return hashlib.sha256(repr((self.images, self.stated, self.earlier)).encode()).hexdigest()


def inputs_of(
    session: Session, hashes: Callable[[Path], str] = file_hash
) -> dict[Stage, StageInputs]:
    """Return the present inputs of every stage.

    Parameters
    ----------
    session : Session
        Images, description and decisions.
    hashes : callable, optional
        Returns the hash of a file; a caching one avoids reading every image again.
    """
    found: dict[Stage, StageInputs] = {}
    for stage in NEEDS:
        folders = (FOLDERS.get(stage, ""), OPTIONAL_FOLDERS.get(stage, ""))
        files = [path for folder in folders if folder for path in session.found(folder)]
        found[stage] = StageInputs(
            tuple((path.name, hashes(path)) for path in files),
            repr(_stated(stage, session)),
            tuple(found[need].fingerprint for need in NEEDS[stage]),
        )
    return found


def all_inputs(session: Session, hashes: Callable[[Path], str] = file_hash) -> str:
    """Return a text that changes with any input of a session's calibration.

    Parameters
    ----------
    session, hashes
        As for :func:`inputs_of`.
    """
    stages = inputs_of(session, hashes)
    curves = sorted(session.decisions.curves.items())
    rests_on = [stages[stage].fingerprint for stage in NEEDS], session.sensor.serial, curves
    return hashlib.sha256(repr(rests_on).encode()).hexdigest()


def changes_between(before: StageInputs, now: StageInputs) -> tuple[str, ...]:
    """Describe what has changed since a result was computed."""
    old, new = dict(before.images), dict(now.images)
    changes = []
    added = [name for name in new if name not in old]
    gone = [name for name in old if name not in new]
    other = [name for name in new if name in old and new[name] != old[name]]
    for names, text in (
        (added, tr("{names} added")),
        (gone, tr("{names} excluded")),
        (other, tr("{names} changed")),
    ):
        if names:
            more = tr(" and {n} more").format(n=len(names) - 3) if len(names) > 3 else ""
            changes.append(text.format(names=", ".join(names[:3]) + more))
    if before.stated != now.stated:
        changes.append(tr("a stated value or a manual correction changed"))
    if before.earlier != now.earlier:
        changes.append(tr("an earlier stage changed"))
    return tuple(changes)


def _stated(stage: Stage, session: Session) -> object:
    """Return the stated values and decisions that a stage uses."""
    sensor, decisions = session.sensor, session.decisions
    match stage:
        case Stage.RESPONSE:
            return session.declared_response, sorted(session.exposures_ms.items())
        case Stage.LENS:
            return session.checkerboard
        case Stage.TOP_POSE:
            return (
                session.top_pose,
                sensor.elastomer_thickness_mm,
                sensor.elastomer_refractive_index,
                sensor.window_thickness_mm,
                sensor.window_refractive_index,
                sensor.working_diameter_mm,
            )
        case Stage.LIGHTS:
            return sensor.led_height_mm, sorted(decisions.spots_px.items())
        case Stage.BALLS:
            radii = sorted(session.ball_radii_mm.items()), session.ball_default_radius_mm
            return radii, sorted(decisions.balls.items())
        case _:
            return None
