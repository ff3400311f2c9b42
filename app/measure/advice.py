"""Advice on the next step on the Measure page. Without Qt."""

from __future__ import annotations

from app.live.advice import PREPARING, LiveState, advise
from gelpolight_core.finding import Finding, Verdict
from gelpolight_core.translation import tr


def measuring_advice(
    now: LiveState, *, frozen: bool, refused: str, findings: tuple[Finding, ...] = ()
) -> Finding | None:
    """Return what to do next.

    Parameters
    ----------
    now : LiveState
        State of the live image.
    frozen : bool
        Whether an image is frozen or was opened, independent of the camera.
    refused : str
        Why that image cannot be measured. Empty if it can.
    findings : tuple of Finding
        About its height map.
    """
    if now.used is None and (frozen or not now.kind):
        if now.reading:
            return PREPARING
        text = tr("No calibration is in use. Depth cannot be measured without one.")
        return Finding("sensors", text)
    if frozen and refused:
        return Finding("live", refused, verdict=Verdict.FAIL)
    if frozen:
        text = " ".join(finding.line for finding in findings)
        return Finding("height_map", text, verdict=Verdict.WARN) if text else None
    if not now.kind:
        text = tr("No camera is selected. Choose one, open an image, or try the virtual sensor.")
        return Finding("virtual", text)
    if (live := advise(now)) is not None:
        return live
    if now.kind == "virtual":
        text = tr("Place a ball, cylinder or cuboid on the virtual bench. It is then pressed in.")
    else:
        text = tr("Press an object into the membrane and hold it still.")
    return Finding("press", text)
