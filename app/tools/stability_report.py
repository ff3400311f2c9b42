"""The stability report for the Tools menu."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from app.tools.report import Progress
from gelpolight_core.experiments.stability import CaseResult, run_cases
from gelpolight_core.experiments.stability_cases import all_cases
from gelpolight_core.experiments.stability_report import summary_line, write_stability
from gelpolight_core.translation import tr


class StabilityReport:
    """Extreme cases: each must be correct or report that it is not."""

    name = "stability"
    title = tr("Numerical stability")
    intro = tr(
        "Runs extreme cases on the virtual sensor. Each result must be correct "
        "within its bound, or be reported as unreliable."
    )
    heads = (tr("Case"), tr("Subject"), tr("Result"), tr("Error um"), tr("What happened"))

    def choices(self) -> Sequence[tuple[str, str]]:
        """Return the quick cases, then every subject."""
        subjects = dict.fromkeys(case.subject for case in all_cases())
        return [(tr("All quick cases"), ""), *((subject, subject) for subject in subjects)]

    def run(self, choice: str, progress: Progress) -> tuple[CaseResult, ...]:
        """Run the cases of a subject, or all quick ones."""
        cases = [c for c in all_cases() if (c.subject == choice if choice else c.quick)]
        return run_cases(cases, progress=progress)

    def rows(self, result: Sequence[CaseResult]) -> Sequence[Sequence[str]]:
        """Return one row for each case."""
        return [
            (
                r.case.label,
                r.case.subject,
                r.outcome.value,
                "" if r.seen is None or r.seen.error_um is None else f"{r.seen.error_um:.3g}",
                r.summary,
            )
            for r in result
        ]

    def summary(self, result: Sequence[CaseResult]) -> str:
        """Return how many were right, refused and wrong."""
        return summary_line(result)

    def write(self, result: Sequence[CaseResult], folder: Path) -> Sequence[Path]:
        """Write the stability report."""
        return write_stability(result, (), (), folder)
