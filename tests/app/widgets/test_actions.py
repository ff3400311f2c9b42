"""An action shows its shortcut in its tooltip."""

import pytest
from PySide6.QtWidgets import QWidget

from app.widgets.actions import make_action


@pytest.mark.parametrize(
    ("keys", "tip", "shown"),
    [
        (("Ctrl+S", "F2"), "Save to a file", "Save to a file (Ctrl+S)"),
        (("Ctrl+S",), "", "Save as (Ctrl+S)"),
        (("",), "Save to a file", "Save to a file"),
        ((), "Save to a file", "Save to a file"),
    ],
)
def test_a_tooltip_names_the_first_shortcut(qtbot, keys, tip, shown):
    owner = QWidget()
    qtbot.addWidget(owner)
    action = make_action(owner, "file.save", "&Save as…", lambda: None, keys=keys, tip=tip)
    assert action.toolTip() == shown
    assert [key.toString() for key in action.shortcuts()] == [key for key in keys if key]
