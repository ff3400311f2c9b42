"""The controls of the virtual sensor, next to the views of a page."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QScrollArea

from app.context.context import SourceChoice


class BenchArea(QScrollArea):
    """Holds the bench panel. It is empty until the virtual sensor is selected.

    Parameters
    ----------
    source : SourceChoice
        The selected source, with its bench.
    """

    def __init__(self, source: SourceChoice) -> None:
        super().__init__()
        self._source = source
        self.setWidgetResizable(True)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)

    def follow(self) -> bool:
        """Show the bench of the selected source. Return whether there is one."""
        info, bench = self._source.info, self._source.bench
        if info is None or info.kind != "virtual" or bench is None:
            return False
        if self.widget() is None:
            from app.bench.bench_panel import BenchPanel  # only needed by the demo

            panel = BenchPanel(bench=bench)
            self.setWidget(panel)
            width = max(panel.minimumWidth(), panel.minimumSizeHint().width())
            self.setMinimumWidth(width + self.verticalScrollBar().sizeHint().width() + 2)
        return True
