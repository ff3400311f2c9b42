"""The quality view shows the selected quantity."""

from dataclasses import replace

import numpy as np

from app.inspect.inspect_views import QualityPanel, legend
from app.live.frame_processor import FrameProcessor, FrameRequest
from app.sources.source import SourceFrame
from gelpolight_core.reconstruction.height_map import Flag, HeightMap


class Reconstruction:
    """Replaces a Reconstructor."""

    def __init__(self, heightmap: HeightMap) -> None:
        self._heightmap = heightmap

    def depth(self, _frame: object, **_requested: object) -> HeightMap:
        return self._heightmap


def test_another_quantity_does_not_show_the_previous_image_and_legend(dome, qtbot):
    """Flags next to the legend of an uncertainty would be misread as one."""
    panel = QualityPanel(lambda: None)
    qtbot.addWidget(panel)
    panel._what.setCurrentIndex(panel._what.findData("uncertainty"))
    assert not panel.map.has_image and "No depth" in panel.map._words.text()
    panel._what.setCurrentIndex(panel._what.findData("flags"))
    processor = FrameProcessor(Reconstruction(dome))  # type: ignore[arg-type]
    processor.wanted = FrameRequest(quality="flags")
    shown = processor(SourceFrame(np.zeros((4, 6, 3), np.uint8), 0, 0.0))
    panel.show_frame(shown, still=True)
    assert panel.map.has_image and panel._legend.text() and not panel.map.bar.isVisible()
    panel._what.setCurrentIndex(panel._what.findData("uncertainty"))
    assert not panel.map.has_image and not panel._legend.text() and not panel.map.bar.isVisible()
    panel.show_frame(replace(shown, quality_top=0.002), still=True)
    assert panel.map.has_image and panel._legend.text() and panel.map.bar.isVisible()


def test_the_legend_states_the_median_misfit(dome, qtbot):
    class Explained(Reconstruction):
        def misfit(self, _frame: object, height_map: HeightMap, *, largest: int) -> np.ndarray:
            return np.full(height_map.depth_mm[:largest, :largest].shape, 0.05, np.float32)

    panel = QualityPanel(lambda: None)
    qtbot.addWidget(panel)
    panel._what.setCurrentIndex(panel._what.findData("misfit"))
    processor = FrameProcessor(Explained(dome))  # type: ignore[arg-type]
    processor.wanted = FrameRequest(quality=panel.what)
    panel.show_frame(processor(SourceFrame(np.zeros((4, 6, 3), np.uint8), 0, 0.0)), still=True)
    assert panel.map.has_image and "Median 5.0 %" in panel._legend.text()


def test_the_legend_names_small_shares_and_breaks_no_entry():
    flags = np.zeros((300, 300), np.uint8)
    flags[0, 0] = Flag.DARK.value
    flags[:30] |= Flag.SATURATED.value
    dark, saturated = legend(flags).split("&nbsp;&nbsp; ")
    assert dark.endswith("&lt;0.1&nbsp;%") and saturated.endswith("&nbsp;10.0&nbsp;%")
    for entry in (dark, saturated):
        assert " " not in entry.partition("</span>")[2]
