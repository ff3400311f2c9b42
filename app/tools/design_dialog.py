"""The check of a sensor design before it is built."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtWidgets import QWidget

from app.context.context import AppContext
from app.tools.work_dialog import WorkDialog
from app.widgets.layout import vbox
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.design_check.check import DesignCheckResult, check_design
from gelpolight_core.finding import Verdict, limit_text, value_text, verdict_word
from gelpolight_core.io.atomic import write_text
from gelpolight_core.io.table import csv_text


class DesignDialog(WorkDialog):
    """Checks a design.

    Parameters
    ----------
    design : SensorDesign
        The design in use.
    context : AppContext
        Settings, and the request to rest.
    parent : QWidget, optional
        Owner.
    """

    def __init__(
        self, design: SensorDesign, *, context: AppContext, parent: QWidget | None = None
    ) -> None:
        title = "Design check"
        super().__init__("design", title, start="&Run", context=context, parent=parent)
        self._design = design
        self.resize(980, 620)
        self.heads = ("Figure", "Value", "Limit", "Result", "Advice")
        self.table = self.result_table(self.heads, len(self.heads) - 1)
        vbox(self.button_row(), (self.table, 1), self.foot_row(), of=self)
        self.say("Checks the design of the virtual sensor.")
        self.allow()

    def run(self) -> None:
        """Check the design in the background."""
        if not self.jobs.busy:
            self.submit(self.windowTitle(), lambda _progress: check_design(self._design))

    def show_result(self, result: DesignCheckResult) -> None:
        """Show the figures, and the verdict of the design."""
        self.table.show_items(_rows(result))
        verdict = verdict_word(result.quality.verdict)
        self.say(f"The design: {verdict}")

    def files_of(self, result: DesignCheckResult, folder: Path) -> Sequence[Path]:
        """Write the table as CSV."""
        path = folder / "design-check.csv"
        write_text(path, csv_text(self.heads, _rows(result)))
        return [path]


def _rows(result: DesignCheckResult) -> list[tuple[str, ...]]:
    """Return one row for each figure; advice only where there is something to do."""
    return [
        (
            f.text,
            value_text(f),
            limit_text(f),
            verdict_word(f.verdict),
            "" if f.verdict is Verdict.PASS else f.remedy,
        )
        for f in result.quality.figures
    ]
