"""Advice on the next step: whether the calibration fits the images, and what is missing."""

from __future__ import annotations

from dataclasses import dataclass

from gelpolight_core.finding import Finding
from gelpolight_core.translation import tr

Size = tuple[int, int]
ZERO_CORRECTS = ("exposure", "led_weak", "room_light")
"""Faults of the light that a new background corrects."""


@dataclass(frozen=True, slots=True)
class Known:
    """What matters here about a calibration: its sensor and its image size (width, height)."""

    serial: str
    size: Size

    def fits(self, serial: str, size: Size | None) -> bool:
        """Whether images can come from this sensor. Unknown properties count as a match."""
        return serial in ("", self.serial) and size in (None, self.size)


@dataclass(frozen=True, slots=True)
class LiveState:
    """The state on which the advice is based.

    Attributes
    ----------
    kind : str
        Kind of the source. Empty if there is none.
    serial : str
        Serial of the sensor of the source. Empty if unknown.
    size : (width, height) or None
        Image size. None before the first image.
    used : Known or None
        The calibration in use.
    other_camera : str
        That it was made with another camera than that of the images. Empty if not.
    calibrations : tuple of Known
        All calibrations.
    trouble : str
        Why there are no images or no depth.
    fault : Finding or None
        What the health check finds in the images.
    reading : bool
        Whether the calibration in use is being read.
    """

    kind: str = ""
    serial: str = ""
    size: Size | None = None
    used: Known | None = None
    other_camera: str = ""
    calibrations: tuple[Known, ...] = ()
    trouble: str = ""
    fault: Finding | None = None
    reading: bool = False


@dataclass(frozen=True, slots=True)
class Advice:
    """A text and the action of the button next to it.

    Attributes
    ----------
    text : str
        Empty if there is nothing to do.
    act, button : str
        Name and label of the button. Empty if there is none.
    role : str
        Colour of the text.
    usable : bool
        Whether the calibration may be used for these images.
    """

    text: str = ""
    act: str = ""
    button: str = ""
    role: str = "text"
    usable: bool = True


def advise(now: LiveState) -> Advice:
    """Return what to do next."""
    if not now.kind:
        return Advice(
            tr("No camera is selected. Choose an image source, or try the virtual sensor."),
            "virtual",
            tr("Use the virtual sensor"),
            usable=False,
        )
    if now.used is None and now.reading:
        return preparing()
    if now.used is None:
        text = tr("No calibration is in use. Only the camera image can be shown.")
        return Advice(text, *_remedy(now), usable=False)
    if not now.used.fits(now.serial, None):
        text = tr(
            "The calibration in use belongs to sensor {one}, but the images come from sensor "
            "{other}."
        ).format(one=now.used.serial, other=now.serial)
        return Advice(text, *_remedy(now), role="fail", usable=False)
    if not now.used.fits("", now.size):
        assert now.size is not None
        text = tr(
            "The images are {a} pixels, but the calibration in use is for {b} pixels."
        ).format(a="x".join(map(str, now.size)), b="x".join(map(str, now.used.size)))
        return Advice(text, *_remedy(now), role="fail", usable=False)
    if now.other_camera:
        remedy = _remedy(now) if _fits(now) else ("same_camera", tr("It is the same camera"))
        return Advice(now.other_camera, *remedy, role="fail", usable=False)
    if now.trouble:
        return Advice(now.trouble, "reopen", tr("Reconnect"), role="fail")
    if now.fault is not None:
        button = ("zero", tr("Set to zero")) if now.fault.key in ZERO_CORRECTS else ("", "")
        return Advice(now.fault.line, *button, role=now.fault.verdict.value)
    return Advice()


def preparing() -> Advice:
    """Return what to say while the calibration in use is being read."""
    return Advice(tr("Preparing the calibration. Please wait."), usable=False)


def _remedy(now: LiveState) -> tuple[str, str]:
    """Return how to get a calibration that fits."""
    if _fits(now):
        return "fitting", tr("Use a matching calibration")
    if now.kind == "virtual":
        return "calibrate", tr("Calibrate the virtual sensor now")
    return "sensors", tr("Choose or calibrate a sensor")


def _fits(now: LiveState) -> bool:
    """Return whether there is a calibration that fits the images and the camera."""
    return any(known.fits(now.serial, now.size) for known in now.calibrations)
