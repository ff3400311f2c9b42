"""What the quality view shows is what was chosen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pytestqt.qtbot import QtBot

from app.inspect.products import Maker, Wanted
from app.inspect.quality_panel import QualityPanel
from app.sources.source import Frame
from gelpolight_core.reconstruction.heightmap import HeightMap


class Reconstruction:
    """Stands for a Reconstructor."""

    def __init__(self, heightmap: HeightMap) -> None:
        self._heightmap = heightmap

    def depth(self, _frame: object, **_wanted: object) -> HeightMap:
        return self._heightmap


def test_another_figure_does_not_show_the_picture_and_words_of_the_one_before(
    dome: HeightMap, qtbot: QtBot
) -> None:
    """Flags beside the colours of an uncertainty would be read as one."""
    panel = QualityPanel()
    qtbot.addWidget(panel)
    panel._what.setCurrentIndex(panel._what.findData("uncertainty"))
    assert not panel.map.has_picture and "No depth" in panel.map._words.text()
    panel._what.setCurrentIndex(panel._what.findData("flags"))
    maker = Maker(Reconstruction(dome))  # type: ignore[arg-type]
    maker.wanted = Wanted(quality="flags")
    shown = maker(Frame(np.zeros((4, 6, 3), np.uint8), 0, 0.0))
    panel.show_frame(shown, still=True)
    assert panel.map.has_picture and panel._legend.text() and panel.bar.isHidden()
    panel._what.setCurrentIndex(panel._what.findData("uncertainty"))
    assert not panel.map.has_picture and not panel._legend.text() and panel.bar.isHidden()
    panel.show_frame(replace(shown, quality_top=0.002), still=True)
    assert panel.map.has_picture and panel._legend.text() and not panel.bar.isHidden()


def test_of_a_standing_picture_it_is_said_whether_an_uncertainty_is_to_come(
    dome: HeightMap, qtbot: QtBot
) -> None:
    """Just after Pause the exact frame is not there yet, and the full model does state one."""
    panel = QualityPanel()
    qtbot.addWidget(panel)
    panel._what.setCurrentIndex(panel._what.findData("uncertainty"))
    maker = Maker(Reconstruction(dome))  # type: ignore[arg-type]
    shown = replace(maker(Frame(np.zeros((4, 6, 3), np.uint8), 0, 0.0)), quality=None)
    for model, words in (("full", "being found out"), ("paper", "states no uncertainty")):
        panel.show_frame(replace(shown, heightmap=replace(dome, model=model)), still=True)
        assert words in panel.map._words.text()
