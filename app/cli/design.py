"""``gelpolight simulate`` and ``design``: a sensor that is not built yet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gelpolight_core.simulation.design_check import check_design
from gelpolight_core.simulation.reflections import Reflection
from gelpolight_core.simulation.sensor_design import SensorDesign, read_design
from gelpolight_core.simulation.simulated_session import simulate_session

from .common import quality_lines, stage_progress
from .options import Command, file_option, option, positional
from .terminal import print_safe


@dataclass(frozen=True)
class SimulateCommand(Command):
    """A session folder of the virtual sensor, with true depths."""

    output: Path = positional("OUT")
    design: Path | None = file_option("sensor design (TOML)")
    closed: bool = option("background, balls and scale only, as of a sensor that cannot be opened")

    def run(self) -> None:
        """Render the session."""
        design = read_design(self.design) if self.design else SensorDesign()
        with stage_progress() as progress:
            simulate_session(design, self.output, closed=self.closed, progress=progress)
        print_safe(f"Session saved to {self.output}")


@dataclass(frozen=True)
class DesignCommand(Command):
    """The check of a sensor design before it is built."""

    design: Path = positional("FILE")

    def run(self) -> None:
        """Print the check of the design."""
        result = check_design(read_design(self.design))
        print_safe("\n".join(quality_lines({"design": result.quality})))
        print_safe("\n".join(reflection_lines(result.reflections)))


def reflection_lines(reflections: Sequence[Reflection]) -> list[str]:
    """Return the pixels where a flat face could mirror an LED if there were air behind it."""
    lines = ["pixels where a face would mirror an LED if there were air behind it:"]
    for r in reflections:
        position = f"pixel ({r.pixel[0]:.0f}, {r.pixel[1]:.0f})"
        where = "inside the image" if r.in_image else "outside the image"
        lines.append(f"  {r.led}  {r.face:<18} {position:<22} {where}, {100 * r.reflectance:.1f} %")
    return lines
