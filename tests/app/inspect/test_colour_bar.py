"""The scale beside a map, also where the map has one value only."""

from __future__ import annotations

import pytest
from pytestqt.qtbot import QtBot

from app.inspect.colour_bar import ColourBar


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.0), (-0.2, -0.2), (0.0, 1e-9), (0.0, 2.5)])
def test_a_map_of_one_value_has_a_scale_like_any_other(
    qtbot: QtBot, low: float, high: float
) -> None:
    """The untouched sensor may have no uncertainty anywhere; that is no reason to stop."""
    bar = ColourBar("bar", "Colours")
    qtbot.addWidget(bar)
    bar.resize(60, 200)
    bar.show_range("inferno", low, high, "um")
    bar.show()
    qtbot.waitExposed(bar)
    assert not bar.grab().isNull()
