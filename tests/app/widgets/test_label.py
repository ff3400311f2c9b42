"""Text from outside is shown literally, and colours follow the theme."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtGui import Qt

import app
from app.widgets.label import PlainLabel

EVIL = ["<img src=x>", "<h1>Sensor 7</h1>", "a <b>bold</b> & @pass note\nof two lines", "&lt;"]
SOURCES = sorted(Path(app.__file__).parent.rglob("*.py"))


@pytest.mark.parametrize("text", EVIL)
def test_a_label_shows_text_from_outside_literally(text, qtbot):
    label = PlainLabel(text)
    qtbot.addWidget(label)
    assert label.textFormat() is Qt.TextFormat.PlainText
    assert label.text() == text


def calls(tree: ast.AST) -> Iterator[tuple[str, ast.Call]]:
    """Yield every call of a module with the last part of its name."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else ""
            yield (node.func.id if isinstance(node.func, ast.Name) else name), node


def is_plain(argument: ast.expr) -> bool:
    """Whether the text of a tooltip comes from the program or is escaped."""
    if isinstance(argument, ast.Call) and isinstance(argument.func, ast.Name):
        return argument.func.id in ("tr", "plain_tip")
    return isinstance(argument, ast.Constant)


# Widgets that guess whether a text is HTML, or always interpret it as HTML.
GUESSING = {"QLabel", "QMessageBox", "QErrorMessage", "QProgressDialog", "QTextBrowser"}
GUESSING |= {"setHtml", "insertHtml", "setTextFormat", "setWhatsThis"}
# The one text above the progress of a turntable.
OWN_TEXTS = {"scene_export.py": {"QProgressDialog"}}


def test_no_widget_interprets_text_as_markup():
    """Every label, tooltip or message box in the program is checked."""
    for source in SOURCES:
        if source.name == "label.py":
            continue
        found = list(calls(ast.parse(source.read_text("utf-8"))))
        allowed = OWN_TEXTS.get(source.name, set())
        assert not {name for name, _ in found} & (GUESSING - allowed), source
        tips = [call.args[0] for name, call in found if name == "setToolTip"]
        assert all(map(is_plain, tips)), source


def test_no_text_keeps_the_colour_of_an_old_theme():
    """A colour in a widget's own style would stay after a change of the theme."""
    for source in SOURCES:
        for name, call in calls(ast.parse(source.read_text("utf-8"))):
            if name == "setStyleSheet" and source.name != "theme.py":
                assert "theme" not in ast.unparse(call), source
