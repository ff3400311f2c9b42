"""What to do next: whether calibration and pictures belong together, and what is missing."""

from __future__ import annotations

from dataclasses import dataclass

from gelpolight_core.translation import tr

Size = tuple[int, int]
GETTING_READY = tr("Getting the calibration ready: one moment.")


@dataclass(frozen=True, slots=True)
class Known:
    """A calibration, as far as it matters here: its sensor and its pictures' (width, height)."""

    serial: str
    size: Size

    def fits(self, serial: str, size: Size | None) -> bool:
        """Whether pictures can be of this sensor; what is not known of them fits."""
        return serial in ("", self.serial) and size in (None, self.size)


@dataclass(frozen=True, slots=True)
class Situation:
    """How things stand.

    Attributes
    ----------
    kind : str
        Of the source; empty where there is none.
    serial : str
        Of the sensor that the source is known to be; empty where that is not known.
    size : (width, height) or None
        Of its pictures; None before the first.
    used : Known or None
        The calibration in use.
    calibrations : tuple of Known
        All calibrations.
    trouble : str
        Why there are no pictures or no depth.
    drift : str
        How far the background has moved.
    reading : bool
        Whether the calibration in use is being read.
    """

    kind: str = ""
    serial: str = ""
    size: Size | None = None
    used: Known | None = None
    calibrations: tuple[Known, ...] = ()
    trouble: str = ""
    drift: str = ""
    reading: bool = False


@dataclass(frozen=True, slots=True)
class Advice:
    """What is said, and what a button beside it does.

    Attributes
    ----------
    text : str
        Empty where all is well.
    act, button : str
        Name and words of the button; empty for none.
    role : str
        Colour of the text.
    usable : bool
        Whether the calibration may be looked through.
    """

    text: str = ""
    act: str = ""
    button: str = ""
    role: str = "text"
    usable: bool = True


def advise(now: Situation) -> Advice:
    """Return what to do next."""
    if not now.kind:
        return Advice(
            tr("No camera: choose where the pictures come from, or try the virtual sensor."),
            "virtual",
            tr("Use the virtual sensor"),
            usable=False,
        )
    if now.used is None and now.reading:
        return Advice(GETTING_READY, usable=False)
    if now.used is None:
        text = tr("No calibration is in use: only the camera's picture can be shown.")
        return Advice(text, *_remedy(now), usable=False)
    if not now.used.fits(now.serial, None):
        text = tr("The calibration in use is of {one}, the pictures are of {other}.").format(
            one=now.used.serial, other=now.serial
        )
        return Advice(text, *_remedy(now), role="fail", usable=False)
    if not now.used.fits("", now.size):
        assert now.size is not None
        text = tr("The pictures are {a}, the calibration in use is for {b} pixels.").format(
            a="x".join(map(str, now.size)), b="x".join(map(str, now.used.size))
        )
        return Advice(text, *_remedy(now), role="fail", usable=False)
    if now.trouble:
        return Advice(now.trouble, "reopen", tr("Open it again"), role="fail")
    if now.drift:
        return Advice(now.drift, "zero", tr("Set to zero"), role="warn")
    return Advice()


def _remedy(now: Situation) -> tuple[str, str]:
    """Return how to come to a calibration that fits."""
    if any(known.fits(now.serial, now.size) for known in now.calibrations):
        return "fitting", tr("Use a calibration that fits")
    if now.kind == "virtual":
        return "calibrate", tr("Calibrate the virtual sensor now")
    return "sensors", tr("Choose or calibrate a sensor")
