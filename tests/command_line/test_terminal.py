"""Text in files does not control the terminal."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import app.command_line
from app.command_line.common import quality_lines
from app.command_line.main import main
from app.command_line.terminal import harmless, say
from gelpolight_core.quality import Figure, QualityTable, Verdict
from gelpolight_core.recording.recording import RecordingHeader
from gelpolight_core.recording.writer import RecordingWriter
from gelpolight_core.records.entry import MeasurementRecord, Quantity
from gelpolight_core.records.records import NAME, Records

# Clears the screen; names the window; writes backwards; forges a line; half a character.
EVIL = "\x1b[2Jcalm\x1b]0;owned\x07\x9b31m\u202egnp\nverdict: pass\udc80"


@given(st.text(st.characters(exclude_categories=())))
def test_no_text_controls_the_terminal(text: str) -> None:
    shown = harmless(text)
    assert not set(shown) & set(map(chr, [*range(32), 127, *range(128, 160), 0x202E, 0x2028]))
    shown.encode("utf-8")


@given(st.text(st.characters(categories=("L", "M", "N", "P", "S", "Zs"))))
def test_normal_text_is_unchanged(text: str) -> None:
    assert harmless(text) == text


def test_a_line_of_the_programs_own_stays_one(capsys: pytest.CaptureFixture[str]) -> None:
    say("a\tb\n\x1b[31mc", end="!\n")
    assert capsys.readouterr().out == "a\tb\n\\x1b[31mc!\n"


def test_text_of_a_recording_is_printed_safely(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its serial, source, settings and note may come from anybody."""
    evil = EVIL.removesuffix("\udc80")
    path = tmp_path / "theirs.gplrec"
    header = RecordingHeader(serial=evil, source=evil, settings={evil: evil}, note=evil)
    with RecordingWriter(path, header) as writer:
        writer.append(np.zeros((8, 8, 3), np.uint8), 0, 0.0)
    assert main(["inspect", str(path)]) == 0
    output = capsys.readouterr().out
    assert output.count(r"\x1b[2Jcalm\x1b]0;owned\x07\x9b31m\u202egnp\nverdict: pass") == 5
    assert len(output.splitlines()) == 12


def test_text_of_records_is_printed_safely(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    evil = EVIL.removesuffix("\udc80")
    with Records.open(tmp_path / NAME) as records:
        quantities = (Quantity("diameter_mm", 5.0, 0.01, 5.0, 5.0),)
        records.add(MeasurementRecord(evil, "c", "ball", quantities, verdict="pass", note=evil))
    assert main(["records", "--workspace", str(tmp_path)]) == 0
    output = capsys.readouterr().out
    assert output.count(r"\x1b[2Jcalm") == 2
    assert len(output.splitlines()) == 2
    assert all(line.isprintable() for line in output.splitlines())


def test_text_of_a_calibration_is_printed_safely() -> None:
    figure = Figure("k", EVIL, 1.0, EVIL, 0.5, 2.0, Verdict.WARN, EVIL)
    lines = quality_lines({EVIL: QualityTable((figure,))})
    assert all(line.isprintable() for line in lines)


def test_a_file_name_in_an_error_is_printed_safely(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["inspect", str(tmp_path / "a\x1b[2Jb.gplcal")]) == 2
    assert r"a\x1b[2Jb.gplcal" in capsys.readouterr().err


def test_commands_print_through_it() -> None:
    """Every command in the program is checked."""
    for file in Path(app.command_line.__file__).parent.glob("*.py"):
        names = [
            node.func.id
            for node in ast.walk(ast.parse(file.read_text("utf-8")))
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
        ]
        assert "print" not in names or file.stem == "terminal", file
