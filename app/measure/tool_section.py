"""The section of the chosen tool, below the views of a press."""

from __future__ import annotations

from contextlib import suppress

from PySide6.QtWidgets import QStackedWidget

from app.measure.work import Work
from app.view2d.profile_plot import ProfilePlot
from app.widgets.label import PlainLabel
from gelpolight_core.errors import InputError


class ToolSection(QStackedWidget):
    """Shows the depth along the chosen tool, if it uses a section."""

    def __init__(self) -> None:
        super().__init__()
        self._words = PlainLabel("Choose a tool that uses a section: profile width (W).")
        self._words.setMargin(20)
        self.plot = ProfilePlot("measure.section.plot")
        for part in (self._words, self.plot):
            self.addWidget(part)

    def show_work(self, work: Work) -> None:
        """Show the section of the chosen tool."""
        found, tool = work.result, work.tool
        profile = None if found is None else found.profile
        if found is None and work.heightmap is not None and tool is not None:
            with suppress(InputError):  # the message is in the inspector
                profile = tool.section(work.heightmap)
        self.setCurrentWidget(self._words if profile is None else self.plot)
        self.plot.show_profile(profile)
        self.plot.show_width(None if found is None else found.width_ends)
