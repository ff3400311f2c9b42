"""The state of a camera, whose settings are applied, read back, and compared."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from app.sources.source import SourceSetting
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Finding, QualityTable, Verdict
from gelpolight_core.session.camera_controls import CONTROLS, MAIN, ORDER
from gelpolight_core.session.camera_settings import CameraSettings

from .driver import CameraDisconnected, CameraFormat, OpenCamera

AUTOMATIC = "The camera sets this automatically: click Lock"
TRIES = 2
"""Some cameras accept a value only after the previous one was processed."""


@dataclass(frozen=True, slots=True)
class AppliedSetting:
    """A setting as requested and as read back.

    Attributes
    ----------
    key : str
        Key of the setting.
    wanted : float
        Requested value.
    read : float or None
        Value read back; None if the camera has no such setting.
    step : float
        Step size of the camera.
    why : str
        Error message of the camera; empty if there was none.
    """

    key: str
    wanted: float
    read: float | None
    step: float = 0.0
    why: str = ""

    @property
    def holds(self) -> bool:
        """Whether the camera has the requested value, within half a step."""
        if self.read is None:
            return False
        return abs(self.read - self.wanted) <= max(0.5 * self.step, 0.005 * abs(self.wanted)) + 1e-6

    @property
    def sentence(self) -> str:
        """Message for the user if the value was not accepted."""
        kind = CONTROLS[self.key]
        if self.read is None:
            return f"{kind.label}: the camera has no such setting"
        return f"{kind.label} is {kind.text(self.read)}, not {kind.text(self.wanted)}"


def apply_settings(
    camera: OpenCamera, requested: Mapping[str, float]
) -> tuple[AppliedSetting, ...]:
    """Apply settings in the order in which they unlock each other, and read them back.

    Parameters
    ----------
    camera : OpenCamera
        Must be delivering images; many cameras forget earlier settings.
    requested : mapping
        Requested value of each setting.

    Raises
    ------
    CameraDisconnected
        If the camera is unplugged meanwhile.
    """
    refusals: dict[str, str] = {}
    for _ in range(TRIES):
        due = [a.key for a in _compare(camera.controls(), requested, refusals) if not a.holds]
        for key in due:
            refusals.pop(key, None)
            try:
                camera.set(key, requested[key])
            except CameraDisconnected:
                raise
            except InputError as error:
                refusals[key] = error.found
    return _compare(camera.controls(), requested, refusals)


def _compare(
    controls: Iterable[SourceSetting], requested: Mapping[str, float], refusals: Mapping[str, str]
) -> tuple[AppliedSetting, ...]:
    control_by_key = {control.key: control for control in controls}
    applied = []
    for key in (key for key in ORDER if key in requested):
        kind, control = CONTROLS[key], control_by_key.get(key)
        if kind.automatic and requested.get(kind.automatic):
            continue  # the camera controls it automatically
        read, step = (None, 0.0) if control is None else (control.value, control.step)
        applied.append(AppliedSetting(key, requested[key], read, step, refusals.get(key, "")))
    return tuple(applied)


def locked_values(controls: Iterable[SourceSetting]) -> dict[str, float]:
    """Return the present settings, with all automatic settings switched to fixed values."""
    values = {}
    for control in controls:
        locked_value = CONTROLS[control.key].locked_value
        values[control.key] = control.value if locked_value is None else locked_value
    return values


def is_locked(controls: Iterable[SourceSetting]) -> bool:
    """Return whether the camera reports no automatic setting."""
    return not any(CONTROLS[c.key].locked_value is not None and c.value for c in controls)


def lock_quality(
    applied: Iterable[AppliedSetting], controls: Iterable[SourceSetting]
) -> QualityTable:
    """Return the figures of a lock: the four important settings, and settings not accepted.

    Parameters
    ----------
    applied : iterable of AppliedSetting
        Requested settings.
    controls : iterable of SourceSetting
        Settings of the camera as read back.
    """
    automatic = [c for c in controls if CONTROLS[c.key].locked_value is not None and c.value]
    figures = [
        Finding(c.key, c.label, c.value, "", None, None, Verdict.FAIL, AUTOMATIC) for c in automatic
    ]
    listed = {control.key for control in automatic}
    in_order = sorted(applied, key=lambda a: ORDER.index(a.key))
    figures += [
        _figure(a) for a in in_order if a.key not in listed and (a.key in MAIN or not a.holds)
    ]
    return QualityTable(tuple(figures))


def _figure(applied: AppliedSetting) -> Finding:
    serious = applied.key in MAIN or CONTROLS[applied.key].locked_value is not None
    value = float("nan") if applied.read is None else applied.read
    verdict, advice = Verdict.PASS, ""
    if not applied.holds:
        verdict = Verdict.FAIL if serious else Verdict.WARN
        text = ": ".join(filter(None, (applied.sentence, applied.why)))
        advice = f"{text}. Choose a value that the camera accepts"
    kind = CONTROLS[applied.key]
    return Finding(applied.key, kind.label, value, kind.unit, None, None, verdict, advice)


def differences(
    stored: CameraSettings, current: CameraFormat | None, controls: Iterable[SourceSetting]
) -> tuple[str, ...]:
    """Return a clause for every difference from the stored settings.

    Parameters
    ----------
    stored : CameraSettings
        Settings of a session or a calibration.
    current : CameraFormat or None
        Format of the camera as read back; None if it is not known.
    controls : iterable of SourceSetting
        Settings of the camera as read back.
    """
    clauses = []
    if current is not None:
        size, expected = (current.width, current.height), stored.size
        if expected not in ((0, 0), size):
            clauses.append("the image size is {}x{}, not {}x{} pixels".format(*size, *expected))
        if stored.pixel_format not in ("", current.code):
            clauses.append(f"the format is {current.code}, not {stored.pixel_format}")
    compared = _compare(controls, stored.controls, {})
    return (*clauses, *(a.sentence for a in compared if not a.holds))


Phase = Literal["closed", "opening", "live", "away"]


@dataclass(frozen=True, slots=True)
class CameraState:
    """The phase of a camera, with its formats and settings as last read back.

    Attributes
    ----------
    phase : str
        ``closed`` (not used), ``opening``, ``live``, or ``away`` (tried again repeatedly).
    sentence : str
        Why the camera is away.
    format : CameraFormat or None
        Format as read back; None before the camera was opened.
    offered : tuple of CameraFormat
        Formats that the camera lists; empty if the system does not report them.
    controls : tuple of SourceSetting
        Settings as last reported by the camera.
    applied : tuple of AppliedSetting
        Settings requested when the camera was opened or set, with their results.
    """

    phase: Phase = "closed"
    sentence: str = ""
    format: CameraFormat | None = None
    offered: tuple[CameraFormat, ...] = ()
    controls: tuple[SourceSetting, ...] = ()
    applied: tuple[AppliedSetting, ...] = ()


def stored_format(settings: CameraSettings | None) -> CameraFormat | None:
    """Return the format stored with settings, if there is one."""
    if settings is None or not settings.pixel_format or settings.size == (0, 0):
        return None
    return CameraFormat(settings.pixel_format, *settings.size, settings.rate_hz)
