"""``gelpolight simulate`` and ``design``: a sensor that is not built yet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from app.command_line.common import quality_lines, stage_progress
from app.command_line.options import Command, file, option, place
from app.command_line.terminal import say
from gelpolight_core.design.sensor_design import SensorDesign, read_design
from gelpolight_core.design_check.check import check_design
from gelpolight_core.design_check.reflections import Reflection
from gelpolight_core.simulation.session import simulate_session


@dataclass(frozen=True)
class Simulate(Command):
    """A session folder of the virtual sensor, with true depths."""

    output: Path = place("OUT")
    design: Path | None = file("sensor design (TOML)")
    closed: bool = option("background, balls and scale only, as of a sensor that cannot be opened")

    def run(self) -> None:
        """Render the session."""
        design = read_design(self.design) if self.design else SensorDesign()
        with stage_progress() as progress:
            simulate_session(design, self.output, closed=self.closed, progress=progress)
        say(f"Session saved to {self.output}")


@dataclass(frozen=True)
class Design(Command):
    """The check of a sensor design before it is built."""

    design: Path = place("FILE")

    def run(self) -> None:
        """Print the check of the design."""
        result = check_design(read_design(self.design))
        say("\n".join(quality_lines({"design": result.quality})))
        say("\n".join(reflection_lines(result.reflections)))


def reflection_lines(reflections: Sequence[Reflection]) -> list[str]:
    """Return the pixels where a flat face could mirror an LED if there were air behind it."""
    lines = ["pixels where a face would mirror an LED if there were air behind it:"]
    for r in reflections:
        position = f"pixel ({r.pixel[0]:.0f}, {r.pixel[1]:.0f})"
        where = "inside the image" if r.in_image else "outside the image"
        lines.append(f"  {r.led}  {r.face:<18} {position:<22} {where}, {100 * r.reflectance:.1f} %")
    return lines
