"""``gelpolight batch`` for the user: exit statuses, one-line messages, resuming."""

import os
import signal
import sys
from pathlib import Path

import pytest

from app.cli import batch
from app.cli.main import INTERRUPTED, MENDABLE, main
from tests.lab.batch.conftest import in_this_process


@pytest.fixture
def command(calibration_file, monkeypatch, tmp_path):
    """Return a function that runs the command, without other processes."""
    monkeypatch.setattr(batch, "process_pool", in_this_process)

    def run(*arguments: str | Path) -> int:
        given = ["batch", calibration_file, *arguments, "--model", "paper"]
        if "-o" not in given:
            given += ["-o", tmp_path / "out"]
        return main([str(part) for part in given])

    return run


def output(capsys: pytest.CaptureFixture[str]) -> str:
    """Return the one line of a refusal."""
    (line,) = [x for x in capsys.readouterr().err.splitlines() if x.startswith("gelpolight:")]
    return line


@pytest.mark.function("`gelpolight batch`: many frames, continued where it was left")
def test_a_second_call_finds_everything_done(command, day, capsys):
    assert command(day) == 0
    assert "6 depth maps in" in capsys.readouterr().out
    assert command(day) == 0
    assert "6 of them from earlier runs" in capsys.readouterr().out


def test_ctrl_c_ends_with_the_frames_at_hand(command, day, capsys, monkeypatch):
    show = batch._show

    def pressed(bar, progress):
        show(bar, progress)
        if progress.done == 2:
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(batch, "_show", pressed)
    assert command(day) == INTERRUPTED
    reported = capsys.readouterr().err
    assert "2 of 6 frames are done" in reported
    assert "gelpolight: Stopped" in reported
    monkeypatch.undo()


@pytest.mark.function("`gelpolight batch --frames`: a choice of frames")
def test_frames_can_be_chosen(command, day, tmp_path):
    assert command(day / "run.gplrec", "--frames", "1:4:2") == 0
    made = sorted(path.name for path in (tmp_path / "out" / "run").iterdir())
    assert made == ["run_000001.npz", "run_000003.npz"]


@pytest.mark.function("`gelpolight batch --measure`: sizes of the pressed objects")
def test_what_is_pressed_can_be_measured(command, day, tmp_path):
    assert command(day / "left" / "a.png", "--measure", "cuboid", "--format", "tif") == 0
    head, row = (tmp_path / "out" / "batch.csv").read_text().splitlines()
    values = dict(zip(head.split(","), row.split(","), strict=True))
    assert values["shape"] == "cuboid"
    assert 2.0 < float(values["side_mm"].split()[0]) < 8.0
    assert (tmp_path / "out" / "a.tif").is_file()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--frames", "x"], "x is not a range of frames"),
        (["--frames", "::0"], "--frames: ::0 is not a range of frames"),
        (["--workers", "0"], "At least one worker is needed"),
        (["--frames", "99:"], "here are no frames"),
        (["--format", "doc"], "Unknown format doc"),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(command, day, capsys, arguments, words):
    assert command(day, *arguments) == MENDABLE
    assert words in output(capsys)


def test_without_dask_the_command_says_what_to_install(command, day, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert command(day, "--workers", "tcp://127.0.0.1:1") == MENDABLE
    assert "Dask is not installed" in output(capsys)
