"""The panel next to the map uses the available space."""

from __future__ import annotations

import pytest
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.measure.side_panel import LIST_HEIGHT, TALL_LIST, SidePanel


@pytest.mark.parametrize(("height", "expected"), [(620, LIST_HEIGHT), (1400, TALL_LIST)])
def test_the_list_of_tools_grows_with_the_window(
    height: int, expected: int, qapp: QApplication, qtbot: QtBot
) -> None:
    panel = SidePanel()
    qtbot.addWidget(panel)
    panel.resize(panel.width(), height)
    panel.show()
    qapp.processEvents()
    assert panel.tools.height() == expected
    assert panel.keep.geometry().bottom() < max(height, panel.widget().height())
