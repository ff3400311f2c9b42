"""The check of a sensor design for the Tools menu."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from app.tools.report import Progress
from app.widgets.quality_table import limit_text, value_text
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.design_check.check import DesignCheckResult, check_design
from gelpolight_core.design_check.lighting import LightingRow, compare_lighting, lighting_name
from gelpolight_core.experiments.report_page import Page, write_page
from gelpolight_core.quality import QualityTable, Verdict, verdict_word
from gelpolight_core.report.document import Listing, Section
from gelpolight_core.translation import tr


@dataclass(frozen=True, slots=True)
class DesignResult:
    """The check of a design, and its light beside directional light."""

    check: DesignCheckResult
    lighting: tuple[LightingRow, ...]


class DesignReport:
    """Checks a sensor design before it is built.

    Parameters
    ----------
    design : SensorDesign
        The design in use.
    """

    name = "design"
    title = tr("Design check")
    intro = tr(
        "Checks the design of the virtual sensor, and presses a cylinder under its LEDs and under "
        "directional light: shadow, and the depth error of the near-light and of the directional "
        "method."
    )
    heads = (tr("Figure"), tr("Value"), tr("Limit"), tr("Result"), tr("Advice"))

    def __init__(self, design: SensorDesign) -> None:
        self._design = design

    def choices(self) -> Sequence[tuple[str, SensorDesign]]:
        """Return the design in use."""
        return [(tr("Virtual sensor {serial}").format(serial=self._design.serial), self._design)]

    def run(self, choice: SensorDesign, progress: Progress) -> DesignResult:
        """Check the design."""
        check = check_design(choice)
        return DesignResult(check, compare_lighting(choice, progress=progress))

    def rows(self, result: DesignResult) -> Sequence[Sequence[str]]:
        """Return one row for each figure, then one for each kind of light."""
        found = [
            (
                f.label,
                value_text(f),
                limit_text(f),
                verdict_word(f.verdict),
                "" if f.verdict is Verdict.PASS else f.advice,
            )
            for f in result.check.quality.figures
        ]
        for row in result.lighting:
            name = lighting_name(row)
            shadow = tr("{p:.1f} % in shadow").format(p=row.shadow_percent)
            errors = tr("depth error: near light {near}, directional {parallel}").format(
                near=_um(row.near_um), parallel=_um(row.parallel_um)
            )
            found.append((name, shadow, "", "", errors))
        return found

    def summary(self, result: DesignResult) -> str:
        """Return the verdict of the design."""
        return tr("The design: {verdict}").format(
            verdict=verdict_word(result.check.quality.verdict)
        )

    def write(self, result: DesignResult, folder: Path) -> Sequence[Path]:
        """Write the table as HTML."""
        rows = tuple(tuple(row) for row in self.rows(result))
        listing = Listing("", self.heads, rows, (3.0, 2.0, 1.0, 1.0, 3.0))
        section = Section("design", self._design.serial, "", QualityTable(), (), (), (listing,))
        page = folder / "design-check.html"
        write_page(Page(self.title, self.intro.rstrip("."), (section,)), page)
        return [page]


def _um(value: float | None) -> str:
    return tr("refused") if value is None else tr("{v:.1f} um").format(v=value)
