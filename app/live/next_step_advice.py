"""Advice on the next step, from the calibration in use and the images."""

from __future__ import annotations

from dataclasses import dataclass

from gelpolight_core.base.finding import Finding, Verdict

Size = tuple[int, int]
ZERO_CORRECTS = ("exposure", "led_weak", "room_light")
"""Faults of the light that a new background corrects."""
BUTTONS = {
    "virtual": "Use the virtual sensor",
    "calibrate": "Calibrate the virtual sensor now",
    "sensors": "Choose or calibrate a sensor",
    "fitting": "Use a matching calibration",
    "same_camera": "It is the same camera",
    "image_size": "Set the camera to this size",
    "reopen": "Reconnect",
    "zero": "Set to zero",
    "live": "Back to the source",
}
"""The text of the button of every action. An advice with such a key has a button."""
OF_CALIBRATION = ("fitting", "calibrate", "sensors", "same_camera", "image_size")
"""Actions that help where the calibration in use is not for the images."""
PREPARING = Finding("preparing", "Preparing the calibration. Please wait.")


@dataclass(frozen=True, slots=True)
class CalibrationTarget:
    """Sensor and image size (width, height) of a calibration, to compare with the images."""

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
    offered : tuple of (width, height)
        Image sizes that the camera offers.
    used : CalibrationTarget or None
        The calibration in use.
    other_camera : str
        Message if the calibration was made with another camera than the images.
    calibrations : tuple of CalibrationTarget
        All calibrations.
    trouble : str
        Why there are no images or no depth.
    fault : Finding or None
        Fault that the health check finds in the images.
    reading : bool
        Whether the calibration in use is being read.
    """

    kind: str = ""
    serial: str = ""
    size: Size | None = None
    offered: tuple[Size, ...] = ()
    used: CalibrationTarget | None = None
    other_camera: str = ""
    calibrations: tuple[CalibrationTarget, ...] = ()
    trouble: str = ""
    fault: Finding | None = None
    reading: bool = False

    @property
    def usable(self) -> bool:
        """Whether the calibration in use may be used for these images."""
        used = self.used
        fits = used is not None and used.fits(self.serial, self.size)
        return bool(self.kind) and fits and not self.other_camera


def action_of(advice: Finding | None) -> str:
    """Return the action that an advice offers, or an empty text."""
    if advice is None:
        return ""
    action = "zero" if advice.key in ZERO_CORRECTS else advice.key
    return action if action in BUTTONS else ""


def is_of_another(advice: Finding | None) -> bool:
    """Return whether an advice says that the calibration in use is not for these images."""
    failed = advice is not None and advice.verdict is Verdict.FAIL
    return failed and action_of(advice) in OF_CALIBRATION


def advise(now: LiveState) -> Finding | None:
    """Return what to do next: its key is the action. None if there is nothing to do."""
    if not now.kind:
        text = "No camera is selected. Choose an image source, or try the virtual sensor."
        return Finding("virtual", text)
    if now.used is None and now.reading:
        return PREPARING
    if now.used is None:
        text = "No calibration is in use. Only the camera image can be shown."
        return Finding(_way_to_fitting(now), text)
    if not now.used.fits(now.serial, None):
        text = (
            f"The calibration in use belongs to sensor {now.used.serial}, "
            "but the images come from sensor "
            f"{now.serial}."
        )
        return Finding(_way_to_fitting(now), text, verdict=Verdict.FAIL)
    if not now.used.fits("", now.size):
        assert now.size is not None
        size, expected = ("x".join(map(str, size)) for size in (now.size, now.used.size))
        text = f"The images are {size} pixels, but the calibration in use is for {expected} pixels."
        can_be_set = now.used.size in now.offered and not now.other_camera
        key = "image_size" if can_be_set else _way_to_fitting(now)
        return Finding(key, text, verdict=Verdict.FAIL)
    if now.other_camera:
        key = "fitting" if _fits(now) else "same_camera"
        return Finding(key, now.other_camera, verdict=Verdict.FAIL)
    if now.trouble:
        return Finding("reopen", now.trouble, verdict=Verdict.FAIL)
    return now.fault


def _way_to_fitting(now: LiveState) -> str:
    """Return the action that gives a calibration that fits."""
    if _fits(now):
        return "fitting"
    return "calibrate" if now.kind == "virtual" else "sensors"


def _fits(now: LiveState) -> bool:
    """Return whether there is a calibration that fits the images and the camera."""
    return any(target.fits(now.serial, now.size) for target in now.calibrations)
