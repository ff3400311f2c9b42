"""Errors of the commands: one line with a remedy, and the exit status."""

import errno
import os
import shutil
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import cv2
import numpy as np
import pytest
from one_line import refusal

from app.cli import calibrate
from app.cli import main as main_module
from app.cli.main import MENDABLE, OUR_FAULT, main
from app.cli.parser import build_parser
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.image.image_file import files_in
from gelpolight_core.session.decisions import Decisions, write_decisions


def damaged(session: Path, tmp_path: Path, damage: Callable[[Path], object]) -> Path:
    """Return a copy of the session with one fault; a few lens views are enough."""
    copy = tmp_path / "copy"
    left_out = shutil.ignore_patterns("presses", "truth", "view_0[6-9].png", "view_1?.png")
    shutil.copytree(session, copy, ignore=left_out)
    damage(copy)
    return copy


def paint(path: Path, change: Callable[[np.ndarray], np.ndarray]) -> None:
    """Rewrite an image after a change of its (rows, columns, 3) uint8 values, BGR."""
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    assert cv2.imwrite(str(path), np.asarray(change(image), np.uint8))


def replace_text(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def first(folder: Path, stage: str) -> Path:
    return next((folder / stage).iterdir())


DAMAGES: dict[str, tuple[Callable[[Path], object], str]] = {
    "no mirror": (lambda f: shutil.rmtree(f / "mirror"), "mirror"),
    "another size": (lambda f: paint(first(f, "whiteboard"), lambda p: p[:-10]), "whiteboard"),
    "black": (lambda f: paint(first(f, "background"), lambda p: p * 0), "dark"),
    "wrong board": (
        lambda f: replace_text(f / "session.toml", "inner_corners = [", "inner_corners = [1"),
        "views",
    ),
    "unknown key": (
        lambda f: replace_text(f / "session.toml", "[sensor]", "[sensor]\ncolour = 1"),
        "colour",
    ),
    "copied stage": (
        lambda f: shutil.copy(first(f, "background"), first(f, "whiteboard")),
        "copy of whiteboard",
    ),
    "no image": (lambda f: first(f, "mirror").write_bytes(b"\x89PNG broken"), "not an image"),
}


@pytest.mark.function(
    "Correct input after one line that says what, where and what to do (exit status 2)"
)
@pytest.mark.parametrize("name", DAMAGES)
def test_a_session_with_a_fault_is_refused_in_one_line_and_nothing_is_written(
    small_session, tmp_path, capsys, name
):
    damage, what = DAMAGES[name]
    folder = damaged(small_session, tmp_path, damage)
    output = tmp_path / "c.gplcal"
    line = refusal(capsys, "calibrate", str(folder), "-o", str(output))
    assert what in line
    assert not output.exists()
    assert not list(tmp_path.glob(".*"))


def test_errors_of_the_command_line_are_reported(session, calibration, press, tmp_path, capsys):
    cal, out = str(calibration), str(tmp_path / "o")
    assert "session.toml" in refusal(capsys, "calibrate", str(tmp_path), "-o", out)
    nowhere = str(tmp_path / "no" / "c.gplcal")
    assert "folder" in refusal(capsys, "calibrate", str(session), "-o", nowhere)
    assert "none.gplcal: " in refusal(capsys, "inspect", str(tmp_path / "none.gplcal"))
    assert "x.png: " in refusal(capsys, "reconstruct", cal, str(tmp_path / "x.png"), "-o", out)
    assert "doc" in refusal(capsys, "reconstruct", cal, str(press), "-o", out, "--format", "doc")
    twice = ("reconstruct", cal, str(press), str(press), "-o", out)
    assert "wo images" in refusal(capsys, *twice)
    # On many file systems the second depth map would overwrite the first.
    cases = [str(shutil.copy(press, tmp_path / name)) for name in ("A.png", "a.tif")]
    assert "wo images" in refusal(capsys, "reconstruct", cal, *cases, "-o", out)
    other = tmp_path / "small.png"
    assert cv2.imwrite(str(other), np.dstack([np.full((9, 9), k, np.uint8) for k in (9, 8, 7)]))
    assert "9x9" in refusal(capsys, "reconstruct", cal, str(other), "-o", out)
    bare = next((session / "background").iterdir())
    nothing = refusal(capsys, "measure", cal, str(bare), "--shape", "ball")
    assert "pressed" in nothing or "nothing" in nothing
    cut = tmp_path / "cut.gplcal"
    cut.write_bytes(calibration.read_bytes()[:-500])
    assert "damaged" in refusal(capsys, "inspect", str(cut))


@pytest.mark.function("Never lose an input file to an output")
def test_no_result_overwrites_its_input(session, calibration, press, tmp_path, capsys):
    """A typing error costs a line of text, not the capture or the calibration."""
    image, cal = tmp_path / "p.tif", tmp_path / "c.gplcal"
    cv2.imwrite(str(image), cv2.imread(str(press), cv2.IMREAD_UNCHANGED))
    shutil.copy(calibration, cal)
    (tmp_path / "link.gplcal").symlink_to(cal)
    ball = session / "balls" / "ball_00.png"
    kept = [path.read_bytes() for path in (image, cal, ball)]
    measure = ("measure", str(cal), str(image), "--shape", "ball", "--json")
    both = ("-o", str(tmp_path / "x"), "--json", str(tmp_path / "x"))
    for arguments in (
        ("reconstruct", str(cal), str(image), "-o", str(tmp_path), "--format", "tif"),
        (*measure, str(cal)),
        (*measure, str(image)),
        (*measure, str(tmp_path / "link.gplcal")),
        ("benchmark", str(cal), str(image), "--json", str(cal)),
        ("calibrate", str(session), "-o", str(ball)),
        ("calibrate", str(session), *both),
    ):
        assert "overwrite" in refusal(capsys, *arguments)
    assert [path.read_bytes() for path in (image, cal, ball)] == kept
    assert not (tmp_path / "x").exists()


def test_no_result_overwrites_files_of_a_session(session, tmp_path, capsys):
    """The image is excluded: it is not used, but can be included again."""
    decided = Decisions(excluded=frozenset({"balls/ball_00.png"}))
    folder = damaged(session, tmp_path, lambda copy: write_decisions(decided, copy))
    new, link = ("-o", str(tmp_path / "c.gplcal")), tmp_path / "r.pdf"
    for file in (folder / name for name in ("session.toml", "decisions.toml", "balls/ball_00.png")):
        kept = file.read_bytes()
        link.unlink(missing_ok=True)
        link.symlink_to(file)
        for command in (
            ("calibrate", str(folder), "-o", str(file)),
            ("calibrate", str(folder), *new, "--json", str(file)),
            ("report", str(folder), "-o", str(link)),
        ):
            assert "overwrite" in refusal(capsys, *command)
        assert file.read_bytes() == kept


def test_system_errors_are_one_sentence(calibration, press, tmp_path, capsys):
    long = "x" * 300
    assert "too long" in refusal(capsys, "simulate", str(tmp_path / long))
    inside = str(press / "session")
    assert "A file has the name" in refusal(capsys, "simulate", inside)
    shutil.copy(press, tmp_path)
    evaluate = ("evaluate", str(calibration), str(tmp_path), "-o", str(tmp_path / "e"))
    assert "truth.csv" in refusal(capsys, *evaluate)
    assert not (tmp_path / "e").exists()


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (("measure", "c", "p.png", "--shape", "star"), "star"),
        (("measure", "c"), "IMAGE"),
        (("benchmark", "c", "p.png", "--repeats", "many"), "many"),
        (("sing",), "sing"),
    ],
)
def test_an_error_in_the_arguments_is_one_line(capsys, arguments, what):
    with pytest.raises(SystemExit) as left:
        main(arguments)
    assert left.value.code == MENDABLE
    (line,) = capsys.readouterr().err.splitlines()
    assert what in line
    assert "--help" in line


@pytest.mark.function("Stop long work with Ctrl-C")
def test_ctrl_c_while_the_program_loads_is_answered(monkeypatch, capsys):
    def interrupt() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(main_module, "build_parser", interrupt)
    assert main(["inspect", "c"]) == main_module.INTERRUPTED
    assert capsys.readouterr().err == "gelpolight: Stopped\n"


@pytest.mark.parametrize("log", [True, False])
def test_an_internal_error_is_one_line_and_a_log_where_one_can_be_written(
    tmp_path, monkeypatch, capsys, log
):
    (tmp_path / "file").touch()
    state = tmp_path if log else tmp_path / "file"
    monkeypatch.setenv("XDG_STATE_HOME", str(state))
    if not log:
        monkeypatch.setattr("tempfile.tempdir", str(state))

    def fail(_path: Path) -> None:
        raise ZeroDivisionError("the tests did it")

    monkeypatch.setattr(calibrate, "session_to_calibrate", fail)
    assert main(["calibrate", str(tmp_path), "-o", str(tmp_path / "c.gplcal")]) == OUR_FAULT
    (line,) = capsys.readouterr().err.splitlines()
    assert "the tests did it" in line
    if log:
        assert "Traceback" in next(tmp_path.rglob("gelpolight-faults.log")).read_text()


def test_a_closed_output_is_not_an_error(calibration, monkeypatch):
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "stderr", None)
    assert main(["inspect", str(calibration)]) == 0
    for stream in (sys.stdout, sys.stderr):
        stream.close()


def test_warnings_of_libraries_go_to_the_log(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))

    def warn(_path: Path) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            # pytest replaces what main set by its own recorder
            warnings.showwarning = main_module._log_warning
            warnings.warn("divide by zero", RuntimeWarning, stacklevel=1)
        raise InputError("stop", where="here", advice="Do")

    monkeypatch.setattr(calibrate, "session_to_calibrate", warn)
    assert main(["calibrate", str(tmp_path), "-o", str(tmp_path / "c.gplcal")]) == MENDABLE
    assert "divide" not in capsys.readouterr().err
    assert "divide by zero" in next(tmp_path.rglob("gelpolight-faults.log")).read_text()


@pytest.mark.function("Be told of too little memory, and what to do")
def test_too_little_memory_is_one_sentence_with_a_remedy(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    reasons = {
        "numpy": lambda: np.empty(2**60, np.uint8),
        "opencv": lambda: cv2.resize(np.zeros((1, 1), np.uint8), (2**31 - 1, 2**31 - 1)),
    }
    for ask in reasons.values():
        monkeypatch.setattr(calibrate, "session_to_calibrate", lambda _path, ask=ask: ask())
        said = refusal(capsys, "calibrate", str(tmp_path), "-o", str(tmp_path / "c.gplcal"))
        assert Remedy.LESS_MEMORY in said


def test_a_folder_that_may_not_be_read_is_not_called_empty(
    calibration, tmp_path, monkeypatch, capsys
):
    """The administrator, who may run this test, can read all folders: the system is replaced."""

    def denied(path: object = ".") -> NoReturn:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))

    for name in ("listdir", "scandir"):
        monkeypatch.setattr(os, name, denied)
    (tmp_path / "in").mkdir()
    said = refusal(
        capsys, "batch", str(calibration), str(tmp_path / "in"), "-o", str(tmp_path / "o")
    )
    assert Remedy.MAY_READ in said
    with pytest.raises(InputError) as refused:
        files_in(tmp_path / "in")
    assert (refused.value.where, refused.value.advice) == (str(tmp_path / "in"), Remedy.MAY_READ)


@pytest.mark.parametrize(
    ("square", "found"),
    [("1.002,5", "1.002,5 could be 1002.5"), ("2.5.1", "'2.5.1' is not a number")],
)
def test_an_option_that_could_be_another_number_is_refused(tmp_path, capsys, square, found):
    assert main(["board", "-o", str(tmp_path / "ours.pdf"), "--square", "2,5"]) == 0
    assert "2.5 mm" in capsys.readouterr().out
    again = "board", "-o", str(tmp_path / "none.pdf"), "--square", square
    assert f"--square: {found}" in refusal(capsys, *again)
    assert not (tmp_path / "none.pdf").exists()


def test_a_comma_between_values_is_distinguished_from_one_before_decimals():
    parser, files = build_parser(), ["a.gplcal", "press.png"]
    arguments = ["--from", "-5,2", "--to", "-.52", "3,5", "-o", "cut.csv"]
    profile = parser.parse_args(["profile", *files, *arguments])
    assert (tuple(profile.start), tuple(profile.end)) == ((-5.0, 2.0), (-0.52, 3.5))
