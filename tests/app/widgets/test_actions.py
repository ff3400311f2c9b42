"""An action shows its shortcut in its tooltip, in the language of the user."""

import pytest
from PySide6.QtCore import QLibraryInfo, QTranslator
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


def test_keys_have_the_names_of_a_german_keyboard(qtbot, qapp):
    owner, translator = QWidget(), QTranslator()
    qtbot.addWidget(owner)
    folder = QLibraryInfo.path(QLibraryInfo.LibraryPath.TranslationsPath)
    assert translator.load("qtbase_de", folder)
    qapp.installTranslator(translator)
    try:
        action = make_action(owner, "a.b", "Rückgängig", lambda: None, keys=("Ctrl+Z",))
    finally:
        qapp.removeTranslator(translator)
    assert action.toolTip() == "Rückgängig (Strg+Z)"
