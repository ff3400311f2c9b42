"""Stage results as images: their place, axes and colour bars."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from pytestqt.qtbot import QtBot

from app.calibrate.maps import MapsView, Panel, Scale, depth_panel, three_maps
from gelpolight_core.optics.resampling import MembraneGrid
from gelpolight_core.reconstruction.height_map import HeightMap

WAIT_MS = 60_000
EXTENT = (-6.0, -4.5, 6.0, 4.5)
GRID = MembraneGrid(np.arange(12.0), np.arange(9.0), 1.0)


def panels(count: int) -> list[Panel]:
    return [Panel(f"{k}", np.zeros((9, 12, 3), np.uint8), EXTENT) for k in range(count)]


def is_filled(view: MapsView, count: int, share: float) -> None:
    assert share * view.width() < view._shown[0].width() <= view.width()
    assert len({shown.geometry().topLeft().toTuple() for shown in view._shown}) == count


@pytest.fixture
def view(qtbot: QtBot) -> MapsView:
    made = MapsView()
    qtbot.addWidget(made)
    made.resize(600, 400)
    made.show()
    return made


def test_a_single_image_uses_the_whole_area(view: MapsView, qtbot: QtBot) -> None:
    for count, share in ((1, 0.9), (2, 0.4), (3, 0.4), (1, 0.9)):
        view.show_panels(panels(count))
        qtbot.waitUntil(partial(is_filled, view, count, share), timeout=WAIT_MS)


def test_an_image_has_axes_in_its_unit_and_a_bar_if_its_colours_have_a_meaning(
    view: MapsView, qtbot: QtBot
) -> None:
    rgb = np.zeros((9, 12, 3), np.uint8)
    in_colours = Panel("depth", rgb, EXTENT, scale=Scale("viridis", 0.0, 2.0, "mm"))
    for panel, unit, has_bar in (
        (in_colours, "mm", True),
        (Panel("photograph", rgb, EXTENT, in_mm=False), "px", False),
    ):
        view.show_panels([panel])
        (shown,) = view._shown
        qtbot.waitUntil(lambda shown=shown: shown._map.height() > 200, timeout=WAIT_MS)
        assert shown._map._unit.text == unit
        assert shown._map._plot.getAxis("bottom").isVisible()
        assert shown._map.bar.isVisible() is has_bar
        assert shown._map._scale.isVisible() is (unit == "mm")


def test_the_bar_has_the_range_of_the_values_and_unknown_nodes_have_no_colour() -> None:
    values = np.linspace(0.2, 0.8, 108, dtype=np.float32).reshape(9, 12)
    known = np.ones((9, 12), np.bool_)
    known[0] = False
    maps = np.repeat(values[..., None], 3, axis=2)
    (red, _green, _blue) = three_maps(maps, known, GRID, "", unit="%", factor=100.0)
    assert red.extent == (-0.5, -0.5, 11.5, 8.5)
    assert red.scale is not None
    assert (red.scale.low, red.scale.high) == pytest.approx(
        (values[1, 0], values[-1, -1]), abs=5e-3
    )
    assert (red.scale.unit, red.scale.factor) == ("%", 100.0)
    assert (red.rgb[0] == red.rgb[0, 0]).all()
    assert (red.rgb[-1, -1] != red.rgb[-1, 0]).any()


def test_a_measured_depth_is_shown_over_the_extent_of_its_map() -> None:
    depth = np.zeros((9, 12), np.float32)
    depth[:] = 0.9
    flags = np.zeros((9, 12), np.uint8)
    heightmap = HeightMap(depth, GRID.x_mm, GRID.y_mm, 1.0, None, flags, "id", "full", "press")
    panel = depth_panel("depth", heightmap, np.array([[4.0, 4.0], [6.0, 4.0], [6.0, 6.0]]))
    assert panel.scale == Scale("viridis", 0.0, 1.0, "mm")
    assert panel.extent == (-0.5, -0.5, 11.5, 8.5)
    assert panel.in_mm
