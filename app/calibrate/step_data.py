"""The data of one step of the wizard."""

from __future__ import annotations

from dataclasses import dataclass

from gelpolight_core.calibration.inputs import FOLDERS, Stage


@dataclass(frozen=True, slots=True)
class Step:
    """One step of the wizard.

    Attributes
    ----------
    key : str
        Short name, used in settings and scripts.
    title : str
        Text in the step list.
    stages : tuple of Stage
        The stages that make up the step; the first one has the images.
    task : str
        Instruction for the technician, in one to three sentences.
    assembly : str
        How the sensor is assembled in this step; a name of :mod:`app.calibrate.assembly`.
    frames : int
        Frames averaged into one capture.
    wanted : int
        Recommended number of captures; 0 if the step captures none.
    least : int
        Smallest number of captures from which the stage can be computed.
    """

    key: str
    title: str
    stages: tuple[Stage, ...]
    task: str
    assembly: str
    frames: int = 1
    wanted: int = 0
    least: int = 1

    @property
    def stage(self) -> Stage | None:
        """The stage to which this step's images belong."""
        return self.stages[0] if self.stages and self.stages[0] in FOLDERS else None

    @property
    def captures(self) -> bool:
        """Whether images are captured in this step."""
        return self.stage is not None and self.wanted > 0

    @property
    def folder(self) -> str:
        """The folder of its images; empty if it has none."""
        return FOLDERS[self.stage] if self.stage is not None else ""
