"""Text in files does not control the terminal."""

import ast
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

import app.cli
from app.cli.main import main
from app.cli.terminal import escape_control

# Clears the screen; names the window; writes backwards; forges a line; half a character.
EVIL = "\x1b[2Jcalm\x1b]0;owned\x07\x9b31m\u202egnp\nverdict: pass\udc80"


@given(st.text(st.characters(exclude_categories=())))
def test_no_text_controls_the_terminal(text):
    shown = escape_control(text)
    assert not set(shown) & set(map(chr, [*range(32), 127, *range(128, 160), 0x202E, 0x2028]))
    shown.encode("utf-8")


@given(st.text(st.characters(categories=("L", "M", "N", "P", "S", "Zs"))))
def test_normal_text_is_unchanged(text):
    assert escape_control(text) == text


def test_a_file_name_in_an_error_is_printed_safely(tmp_path, capsys):
    assert main(["inspect", str(tmp_path / "a\x1b[2Jb.gplcal")]) == 2
    assert r"a\x1b[2Jb.gplcal" in capsys.readouterr().err


def test_commands_print_through_it():
    """Every command in the program is checked."""
    for file in Path(app.cli.__file__).parent.glob("*.py"):
        names = [
            node.func.id
            for node in ast.walk(ast.parse(file.read_text("utf-8")))
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
        ]
        assert "print" not in names or file.stem == "terminal", file
