"""What the Measure page says to do next; no Qt."""

from __future__ import annotations

from app.inspect.advice import GETTING_READY, Advice, Situation, advise
from gelpolight_core.translation import tr


def measuring_advice(
    now: Situation, *, held: bool, refused: str, notes: tuple[str, ...] = ()
) -> Advice:
    """Return what to do next.

    Parameters
    ----------
    now : Situation
        Of the live picture.
    held : bool
        Whether a picture is held or was opened, whatever the camera does.
    refused : str
        Why that picture cannot be measured on; empty where it can.
    notes : tuple of str
        What its reconstruction has to say.
    """
    live = advise(now)
    if now.used is None and (held or not now.kind):
        if now.reading:
            return Advice(GETTING_READY, usable=False)
        text = tr("No calibration is in use: depth cannot be measured without one.")
        return Advice(text, "sensors", tr("Choose or calibrate a sensor"), usable=False)
    if held:
        if refused:
            return Advice(refused, "live", tr("Back to the camera"), "fail", live.usable)
        text = "; ".join(note[:1].upper() + note[1:] for note in notes)
        return Advice(text, role="warn" if text else "text", usable=live.usable)
    if not now.kind:
        text = tr("No camera: choose one, open a picture, or try the virtual sensor.")
        return Advice(text, "virtual", tr("Use the virtual sensor"), usable=False)
    if live.text:
        return live
    if now.kind == "virtual":
        return Advice(tr("Lay a ball, cylinder or cuboid on the virtual bench: it is pressed in."))
    return Advice(tr("Press an object into the membrane and hold it still."))
