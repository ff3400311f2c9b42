"""What the user prefers: one declaration for the settings file and for the dialog."""

from __future__ import annotations

from dataclasses import dataclass

from gelpolight_core.base.compared_quantity import PAPER_PERCENT
from gelpolight_core.base.form_fields import choice, folder, number
from gelpolight_core.reconstruction.modes import MODES, Mode

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
