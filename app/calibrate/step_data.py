"""The data of one step of the wizard."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from gelpolight_core.calibration.recipe import Stage


@dataclass(frozen=True, slots=True)
class Step:
    """One step of the wizard.

    Attributes
    ----------
    key : str
        Short name, used in settings and scripts.
    title : str
        Text in the step list.
    stages : tuple of str
        Keys of the stages that make up the step; the first one has the images.
    task : str
        Instruction for the technician, in one sentence.
    assembly : str
        How the sensor is assembled in this step; a name of :mod:`app.calibrate.assembly`.
    frames : int
        Frames averaged into one capture; 0 if none is captured in the step.
    wanted : int
        Recommended number of captures that are kept.
    least : int
        Smallest number of captures from which the stage can be computed.
    folder : str
        Folder of its images; empty if it has none.
    one_image : bool
        Whether a new image replaces the former one.
    advice : str
        More about the set-up, for the help.
    button : str
        Text of the button that captures; empty for the usual one.
    figure : str
        Key of the one figure that the step shows; empty for the first one of its stages.
    """

    key: str
    title: str
    stages: tuple[str, ...]
    task: str
    assembly: str
    frames: int = 0
    wanted: int = 0
    least: int = 1
    folder: str = ""
    one_image: bool = False
    advice: str = ""
    button: str = ""
    figure: str = ""

    @property
    def stage(self) -> str | None:
        """Key of the stage to which this step's images belong."""
        return self.stages[0] if self.folder else None

    @property
    def captures(self) -> bool:
        """Whether images are captured in this step."""
        return self.frames > 0


def step_of(stage: Stage[Any], task: str, assembly: str, **more: Any) -> Step:
    """Return the step of a stage; arguments as in :class:`Step`."""
    return Step(
        stage.key,
        stage.title,
        (stage.key,),
        task,
        assembly,
        folder=stage.folder,
        one_image=stage.one_image,
        **more,
    )
