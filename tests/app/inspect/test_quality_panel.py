"""The quality view shows the selected quantity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pytestqt.qtbot import QtBot

from app.inspect.quality_panel import QualityPanel
from app.live.frame_results import Maker, Wanted
from app.sources.source import Frame
from gelpolight_core.reconstruction.height_map import HeightMap


class Reconstruction:
    """Replaces a Reconstructor."""

    def __init__(self, heightmap: HeightMap) -> None:
        self._heightmap = heightmap

    def depth(self, _frame: object, **_wanted: object) -> HeightMap:
        return self._heightmap


def test_another_quantity_does_not_show_the_previous_image_and_legend(
    dome: HeightMap, qtbot: QtBot
) -> None:
    """Flags next to the legend of an uncertainty would be misread as one."""
    panel = QualityPanel()
    qtbot.addWidget(panel)
    panel._what.setCurrentIndex(panel._what.findData("uncertainty"))
    assert not panel.map.has_image and "No depth" in panel.map._words.text()
    panel._what.setCurrentIndex(panel._what.findData("flags"))
    maker = Maker(Reconstruction(dome))  # type: ignore[arg-type]
    maker.wanted = Wanted(quality="flags")
    shown = maker(Frame(np.zeros((4, 6, 3), np.uint8), 0, 0.0))
    panel.show_frame(shown, still=True)
    assert panel.map.has_image and panel._legend.text() and not panel.map.bar.isVisible()
    panel._what.setCurrentIndex(panel._what.findData("uncertainty"))
    assert not panel.map.has_image and not panel._legend.text() and not panel.map.bar.isVisible()
    panel.show_frame(replace(shown, quality_top=0.002), still=True)
    assert panel.map.has_image and panel._legend.text() and panel.map.bar.isVisible()


def test_a_closed_sensor_offers_no_misfit(dome: HeightMap, qtbot: QtBot) -> None:
    """Its three colours determine the slopes and nothing else: the misfit was 0 by construction."""
    panel = QualityPanel()
    qtbot.addWidget(panel)
    panel._what.setCurrentIndex(panel._what.findData("misfit"))
    frame = Frame(np.zeros((4, 6, 3), np.uint8), 0, 0.0)
    maker = Maker(Reconstruction(replace(dome, model="in-place")))  # type: ignore[arg-type]
    maker.wanted = Wanted(quality=panel.what)
    shown = maker(frame)
    assert shown.misfit is None
    with qtbot.waitSignal(panel.chosen):
        panel.show_frame(shown, still=True)
    assert panel._what.findData("misfit") < 0 and panel.what == "flags"
    maker = Maker(Reconstruction(dome))  # type: ignore[arg-type]
    maker.wanted = Wanted(quality=panel.what)
    panel.show_frame(maker(frame), still=True)
    assert panel._what.findData("misfit") >= 0
