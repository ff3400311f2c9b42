"""Advice on the next step on the Measure page. Without Qt."""

from __future__ import annotations

from app.live.advice import Advice, LiveState, advise, preparing
from gelpolight_core.finding import Finding
from gelpolight_core.translation import tr


def measuring_advice(
    now: LiveState, *, frozen: bool, refused: str, findings: tuple[Finding, ...] = ()
) -> Advice:
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
    live = advise(now)
    if now.used is None and (frozen or not now.kind):
        if now.reading:
            return preparing()
        text = tr("No calibration is in use. Depth cannot be measured without one.")
        return Advice(text, "sensors", tr("Choose or calibrate a sensor"), usable=False)
    if frozen:
        if refused:
            return Advice(refused, "live", tr("Back to the camera"), "fail", live.usable)
        text = " ".join(finding.line for finding in findings)
        return Advice(text, role="warn" if text else "text", usable=live.usable)
    if not now.kind:
        text = tr("No camera is selected. Choose one, open an image, or try the virtual sensor.")
        return Advice(text, "virtual", tr("Use the virtual sensor"), usable=False)
    if live.text:
        return live
    if now.kind == "virtual":
        return Advice(
            tr("Place a ball, cylinder or cuboid on the virtual bench. It is then pressed in.")
        )
    return Advice(tr("Press an object into the membrane and hold it still."))
