"""The controls of the virtual sensor, next to the views of a page."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

from app.context.context import SourceChoice
from app.widgets.layout import vbox


class BenchArea(QWidget):
    """Holds the bench panel. It is empty until the virtual sensor is selected.

    Parameters
    ----------
    source : SourceChoice
        The selected source, with its bench.
    """

    def __init__(self, source: SourceChoice) -> None:
        super().__init__()
        self._source = source
        self._column = vbox(of=self, margins=0)

    def follow(self) -> bool:
        """Show the bench of the selected source. Return whether there is one."""
        bench = self._source.virtual
        if bench is None:
            return False
        if not self._column.count():
            from app.bench.bench_panel import BenchPanel  # only needed by the demo

            self._column.addWidget(BenchPanel(bench=bench))
        return True
