"""What the Measure page says to do next; no Qt."""

from __future__ import annotations

from dataclasses import dataclass

from gelpolight_core.translation import tr

Advice = tuple[str, tuple[str, str], str]
"""A sentence, a button (name, text) or two empty words, and the colour's role."""


@dataclass(frozen=True, slots=True)
class Situation:
    """How the page stands.

    Attributes
    ----------
    kind : str
        Of the source; empty where there is none.
    has_calibration, held, busy, has_tools : bool
        Whether a calibration is in use, a picture is held, something is being measured, and tools
        are on the picture.
    trouble : str
        What is wrong, as a sentence.
    """

    kind: str = ""
    has_calibration: bool = False
    held: bool = False
    busy: bool = False
    has_tools: bool = False
    trouble: str = ""


def advice(now: Situation) -> Advice:
    """Return what to do next; an empty sentence where nothing needs to be said."""
    none = ("", "")
    if not now.has_calibration:
        text = tr("No calibration is in use: depth cannot be measured without one.")
        if now.kind == "virtual":
            return text, ("calibrate", tr("Calibrate the virtual sensor now")), ""
        return text, ("sensors", tr("Choose or calibrate a sensor")), ""
    if now.trouble:
        act = ("live", tr("Back to the camera")) if now.held else ("reopen", tr("Open it again"))
        return now.trouble, act, "fail"
    if now.held:
        return "", none, ""
    if not now.kind:
        text = tr("No camera: choose one, open a picture, or try the virtual sensor.")
        return text, ("virtual", tr("Use the virtual sensor")), ""
    text = tr("Press an object into the membrane and hold it still.")
    if now.kind == "virtual":
        text = tr("Lay a ball, cylinder or cuboid on the virtual bench: it is pressed at once.")
    return text, none, ""
