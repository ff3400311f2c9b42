"""What the user prefers: one declaration for settings file, dialog and commands."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import Field, dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

import platformdirs

from gelpolight_core.base.compared_quantity import PAPER_PERCENT
from gelpolight_core.base.form_fields import choice, folder, is_possible, number
from gelpolight_core.base.safe_reading import read_file
from gelpolight_core.reconstruction.modes import MODES, Mode

APPLICATION = "gelpolight"
MOST_BYTES = 10_000_000
StoredT = TypeVar("StoredT")


def settings_file() -> Path:
    """Return the INI file of the user."""
    return platformdirs.user_config_path(APPLICATION) / "desktop.ini"


def read_stored_settings(kind: type[StoredT], stored: Callable[[str], object]) -> StoredT:
    """Return kept values. One that is missing or not possible gets its default."""
    values = {f.name: _value(str(stored(f.name)), f) for f in fields(kind)}  # type: ignore[arg-type]
    return kind(**{name: value for name, value in values.items() if value is not None})


def read_settings_section(kind: type[StoredT], section: str) -> StoredT:
    """Return the values of a section of the user's file, as Qt reads them.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    try:
        text = read_file(settings_file(), MOST_BYTES).decode(errors="replace")
    except FileNotFoundError:
        return kind()
    sections = re.findall(rf"^\[{section}\]$(.*?)(?=^\[|\Z)", text, re.MULTILINE | re.DOTALL)
    values = dict(re.findall(r"^(\w+)=(.*)$", "".join(sections), re.MULTILINE))
    return read_stored_settings(kind, lambda name: values.get(name, ""))


def _value(text: str, f: Field[Any]) -> str | float | None:
    """Return a kept value of a field, or None if it is not possible."""
    value: str | float | None = text
    if isinstance(f.default, bool):
        value = {"yes": True, "no": False}.get(text)
    elif isinstance(f.default, float):
        with suppress(ValueError):
            value = float(text)
    return value if is_possible(f, value) else None


SPEEDS = {f"{m.model}/{m.effort}": m.label for m in MODES}
ABOUT_SPEED = (
    "Accuracy or speed of live images, as on the Inspect page. Frozen images always have the full "
    "accuracy of the model"
)
ABOUT_RECORDING = "A recording stops at this size. Cameras need 2 GB a minute"
ABOUT_TOLERANCE = (
    "Largest deviation from a reference. Within it less the uncertainty an object conforms, beyond "
    "it plus the uncertainty it does not"
)
THEMES = {"system": "Same as the desktop", "light": "Light", "dark": "Dark"}


@dataclass(frozen=True, slots=True)
class Preferences:
    """Preferences. Every field has a default, which replaces a value that is not possible."""

    theme: str = choice("system", "&Theme", THEMES)
    reconstruction: str = choice("full/fast", "&Live depth", SPEEDS, ABOUT_SPEED)
    workspace: str = folder(
        "", "&Workspace folder", "Folder for sensors, calibrations and sessions"
    )
    # About ten minutes of a fast camera.
    recording_limit_gb: float = number(
        20.0, "Largest recording", 0.1, 10_000.0, " GB", 1, tip=ABOUT_RECORDING
    )
    captures_automatically: bool = True
    shows_first_steps: bool = True

    @property
    def mode(self) -> Mode:
        """Model and effort of the live depth."""
        return Mode(*self.reconstruction.split("/"))


@dataclass(frozen=True, slots=True)
class WarningLimits:
    """Limits from which on an old calibration and a wrong measurement cause a warning.

    Attributes
    ----------
    age_days : float
        An older calibration is marked: gel yellows and hardens within months.
    height_percent, size_percent : float
        Tolerances of measurements of known objects. The defaults are the errors that the paper
        reports for its own sensor: 8 % in depth and 5 % in the plane.
    """

    age_days: float = number(90.0, "Mark calibrations older than", 1.0, 3650.0, " d")
    height_percent: float = number(
        PAPER_PERCENT["depth"], "Tolerance of heights", 0.1, 100.0, " %", 1, tip=ABOUT_TOLERANCE
    )
    size_percent: float = number(
        PAPER_PERCENT["planar"], "Tolerance of sizes", 0.1, 100.0, " %", 1, tip=ABOUT_TOLERANCE
    )

    @property
    def percent(self) -> tuple[float, float]:
        """The limits of size and height."""
        return self.size_percent, self.height_percent
