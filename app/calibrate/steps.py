"""The steps through which a sensor is calibrated, as plain data."""

from __future__ import annotations

from dataclasses import dataclass

from gelpolight_core.calibration.inputs import FOLDERS, Stage
from gelpolight_core.optics.lens_views import MIN_VIEWS
from gelpolight_core.translation import tr


@dataclass(frozen=True, slots=True)
class Step:
    """One step of the wizard.

    Attributes
    ----------
    key : str
        Short name, for settings and scripts.
    title : str
        What the step list says.
    stages : tuple of Stage
        The stages whose state is the step's; the first has the pictures.
    task : str
        What the technician does, in one or two sentences.
    assembly : str
        How the sensor is put together now; a name of :mod:`app.calibrate.assembly`.
    frames : int
        Frames averaged into one capture.
    wanted : int
        Captures that make a good stage.
    least : int
        Captures without which there is no stage.
    """

    key: str
    title: str
    stages: tuple[Stage, ...]
    task: str
    assembly: str
    frames: int = 1
    wanted: int = 1
    least: int = 1

    @property
    def stage(self) -> Stage | None:
        """The stage with this step's pictures."""
        return self.stages[0] if self.stages and self.stages[0] in FOLDERS else None

    @property
    def folder(self) -> str:
        """The folder of its pictures; empty where it has none."""
        return FOLDERS[self.stage] if self.stage is not None else ""


def all_steps() -> tuple[Step, ...]:
    """Return the steps in the order in which they are done."""
    return (
        Step(
            "setup",
            tr("Set-up"),
            (Stage.RESPONSE,),
            tr(
                "State what you know of the sensor from its housing and parts. Every length here"
                " scales the result."
            ),
            "complete",
        ),
        Step(
            "lens",
            tr("Lens"),
            (Stage.LENS,),
            tr(
                "Camera alone. Hold the checkerboard before it and tilt it each time another way,"
                " 15 to 40 degrees, until its corners have been all over the picture."
            ),
            "camera",
            wanted=12,
            least=MIN_VIEWS,
        ),
        Step(
            "top_pose",
            tr("Top surface"),
            (Stage.TOP_POSE,),
            tr(
                "Mount the housing, without elastomer. Lay the small checkerboard flat on the top"
                " opening, pattern down."
            ),
            "board",
            frames=8,
        ),
        Step(
            "lights",
            tr("Lights"),
            (Stage.LIGHTS,),
            tr(
                "Replace the board by the mirror, all three LEDs on, room dark. Shorten the"
                " exposure until the three spots are small and not saturated."
            ),
            "mirror",
            frames=16,
        ),
        Step(
            "radiance",
            tr("Light intensity"),
            (Stage.RADIANCE,),
            tr(
                "Put the elastomer in, without membrane, and press the white board on it without"
                " air between. Expose so that nothing is saturated, and keep that exposure."
            ),
            "whiteboard",
            frames=16,
        ),
        Step(
            "background",
            tr("Background"),
            (Stage.BACKGROUND,),
            tr(
                "Mount the membrane. Let nothing touch it, and keep exposure and light as they are."
            ),
            "membrane",
            frames=16,
        ),
        Step(
            "balls",
            tr("Ball presses"),
            (Stage.BALLS,),
            tr(
                "Press a ball of known radius into the membrane, at places all over the field and"
                " to different depths. State its radius for each press."
            ),
            "ball",
            frames=4,
            wanted=10,
        ),
        Step(
            "refraction",
            tr("Refraction"),
            (Stage.BALLS,),
            tr(
                "Compare a press near the rim before and after the correction: the contact's"
                " ellipse must have become a circle."
            ),
            "ball",
        ),
        Step(
            "reflectance",
            tr("Reflectance"),
            (Stage.REFLECTANCE,),
            tr(
                "Look at the curves fitted to the ball presses, and correct them by hand where"
                " dirt or shadows have misled them."
            ),
            "ball",
        ),
        Step(
            "result",
            tr("Calibration"),
            (Stage.JOINT,),
            tr("Look at all figures together, then save the calibration."),
            "complete",
        ),
        Step(
            "validation",
            tr("Validation"),
            (),
            tr(
                "Press an indenter of known size. Only a sensor that measures it within the limits"
                " is called validated."
            ),
            "indenter",
        ),
    )
