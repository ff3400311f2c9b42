"""The section of the chosen tool, below the views of a press."""

from __future__ import annotations

import numpy as np
from PySide6.QtWidgets import QStackedWidget

from app.measure.work import Work
from app.view2d.profile_plot import ProfilePlot
from app.widgets.label import PlainLabel
from gelpolight_core.errors import InputError
from gelpolight_core.measurement.profile import Profile, take_profile
from gelpolight_core.measurement.profile_tools import ProfileWidth
from gelpolight_core.translation import tr


class ToolSection(QStackedWidget):
    """Shows the depth along the chosen tool, if it uses a section."""

    def __init__(self) -> None:
        super().__init__()
        self._words = PlainLabel(tr("Choose a tool that uses a section: profile width (W)."))
        self._words.setMargin(20)
        self.plot = ProfilePlot("measure.section.plot")
        for part in (self._words, self.plot):
            self.addWidget(part)

    def show_work(self, work: Work) -> None:
        """Show the section of the chosen tool."""
        found = work.result
        profile = _section_of(work) if found is None else found.profile
        self.setCurrentWidget(self._words if profile is None else self.plot)
        self.plot.show_profiles({} if profile is None else {1: profile})
        width = None
        if found is not None and profile is not None and isinstance(found.tool, ProfileWidth):
            ends = np.linalg.norm(found.drawing_mm[1] - np.array(profile.start_mm), axis=1)
            width = float(ends[0]), float(ends[1]), found["level"].value
        self.plot.show_width(width)


def _section_of(work: Work) -> Profile | None:
    """Return the section of a tool that could not measure, to show the reason."""
    tool = work.tool
    if work.heightmap is None or not isinstance(tool, ProfileWidth):
        return None
    try:
        return take_profile(work.heightmap, tool.start_mm, tool.end_mm, width_mm=tool.width_mm)
    except InputError:
        return None  # the message is in the inspector
