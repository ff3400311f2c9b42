"""The controls of the virtual sensor, next to the views of a page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtWidgets import QWidget

from app.context.context import SourceChoice
from app.widgets.layout import vbox

if TYPE_CHECKING:
    from app.bench.bench_panel import BenchPanel


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
        self._panel: BenchPanel | None = None

    def follow(self) -> bool:
        """Show the bench of the selected source. Return whether there is one."""
        bench = self._source.virtual
        if bench is None:
            return False
        if self._panel is None:
            from app.bench.bench_panel import BenchPanel  # only needed by the demo

            self._panel = BenchPanel(bench=bench)
            self._column.addWidget(self._panel)
        return True

    def choose_item(self) -> None:
        """Show the list of objects."""
        if self._panel is not None:
            self._panel.choose_item()
