"""The commands as a technician types them: results, one-line refusals, exit statuses."""

from __future__ import annotations

import json
import shutil
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.command_line import calibrate
from app.command_line import main as main_module
from app.command_line.main import MENDABLE, OUR_FAULT, main
from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.errors import InputError
from gelpolight_core.simulation.session import simulate_session

SCALE = 0.5


@pytest.fixture(scope="session")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a session folder of the virtual sensor, at half the picture's size."""
    folder = tmp_path_factory.mktemp("virtual") / "session"
    simulate_session(SensorDesign(), folder, scale=SCALE)
    return folder


@pytest.fixture(scope="session")
def calibration(session: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the calibration that the command makes of it."""
    path = tmp_path_factory.mktemp("made") / "c.gplcal"
    assert main(["calibrate", str(session), "-o", str(path), "--model", "paper"]) == 0
    return path


@pytest.fixture
def press(session: Path) -> Path:
    """Return a picture of a pressed cylinder."""
    return session / "presses" / "cylinder_s5_d100.png"


def refusal(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Run a command that must be refused, and return its one line."""
    assert main(arguments) == MENDABLE
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("gelpo")]
    assert len(lines) == 1
    assert "Traceback" not in lines[0]
    return lines[0]


def test_a_calibration_of_the_virtual_sensor_finds_its_truth(session: Path, tmp_path: Path) -> None:
    """The bars are the issue's for a whole picture, doubled for a picture of half the size."""
    results = tmp_path / "c.json"
    status = main(
        ["calibrate", str(session), "-o", str(tmp_path / "c.gplcal"), "--json", str(results)]
    )
    assert status == 0
    found, truth = json.loads(results.read_text()), json.loads((session / "truth.json").read_text())
    assert found["camera"]["fx"] == pytest.approx(truth["camera"]["fx"], rel=0.002)
    plane = truth["top_plane"]
    assert found["top_plane"]["distance_mm"] == pytest.approx(plane["offset_mm"], rel=0.002)
    cosine = np.dot(found["top_plane"]["normal_camera"], plane["normal_camera"])
    assert np.degrees(np.arccos(min(cosine, 1.0))) < 0.2
    leds = np.array([truth["leds"][k]["camera_mm"] for k in "RGB"])
    assert np.linalg.norm(np.array(found["led_positions_camera_mm"]) - leds, axis=1).max() < 0.35
    by_file = {b["file"]: b for b in truth["balls"]}
    errors = [
        np.hypot(*np.subtract(b["centre_mm"], by_file[b["file"]]["centre_sensor_xy_mm"]))
        for b in found["balls"]
    ]
    assert np.median(errors) < 0.05
    assert max(errors) < 0.15


def test_inspect_shows_who_made_it_and_how_good_it_is(
    calibration: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["inspect", str(calibration)]) == 0
    shown = capsys.readouterr().out
    for word in ("calibration", "verdict", "made", "focal length", "top_pose", "reflectance"):
        assert word in shown


def test_a_press_becomes_a_depth_map_in_every_format(
    calibration: Path, press: Path, tmp_path: Path
) -> None:
    arguments = ["reconstruct", str(calibration), str(press), "-o", str(tmp_path / "out")]
    formats = "npz,tif,vtp,ply,stl,gsf"
    assert main([*arguments, "--format", formats, "--model", "paper", "--pictures"]) == 0
    names = sorted(p.name for p in (tmp_path / "out").iterdir())
    assert names == [f"{press.stem}.{e}" for e in ("gsf", "npz", "ply", "png", "stl", "tif", "vtp")]
    assert cv2.imread(str(tmp_path / "out" / f"{press.stem}.png")).std() > 10
    with np.load(tmp_path / "out" / f"{press.stem}.npz", allow_pickle=False) as data:
        depth, pitch = data["depth_mm"], float(data["pitch_mm"])
        assert depth.dtype == np.float32
        assert data["flags"].dtype == np.uint8
        assert data["x_mm"].shape == (depth.shape[1],)
        assert np.diff(data["x_mm"]) == pytest.approx(pitch)
        assert {"calibration_id", "flag_names", "normals", "y_mm"} <= set(data)
    assert np.nanmax(depth) == pytest.approx(1.0, rel=0.08)


def test_a_press_is_measured_against_its_truth(
    session: Path, calibration: Path, press: Path, tmp_path: Path
) -> None:
    result = tmp_path / "m.json"
    truth = session / "presses" / "truth.csv"
    arguments = ["measure", str(calibration), str(press), "--shape", "cylinder"]
    assert main([*arguments, "--truth", str(truth), "--json", str(result)]) == 0
    m = json.loads(result.read_text())
    assert {"shape", "diameter_mm", "height_mm", "centre_mm", "yaw_deg", "drape_decay_mm"} <= set(m)
    assert {"sd", "truth", "error_percent", "verdict", "reason"} <= set(m)
    # The paper's model states neither.
    assert m["noise_sd"] is None
    assert m["calibration_sd"] is None
    assert m["diameter_mm"] == pytest.approx(5.0, rel=0.06)
    assert m["height_mm"] == pytest.approx(1.0, rel=0.06)


def test_the_full_model_says_how_sure_it_is(
    virtual_session: Path,
    virtual_calibration: Calibration,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file, name = tmp_path / "full.gplcal", "cylinder_s5_d100"
    write_calibration(virtual_calibration, file)
    picture = str(virtual_session / "presses" / f"{name}.png")
    result = tmp_path / "m.json"
    assert main(["measure", str(file), picture, "--shape", "cylinder", "--json", str(result)]) == 0
    assert "calibration 0.00" in capsys.readouterr().out
    m = json.loads(result.read_text())
    assert set(m["noise_sd"]) == set(m["calibration_sd"]) == set(m["sd"])
    for key in ("height_mm", "diameter_mm"):
        assert m["sd"][key] >= np.hypot(m["noise_sd"][key], m["calibration_sd"][key]) * 0.999
    assert main(["reconstruct", str(file), picture, "-o", str(tmp_path), "--uncertainty"]) == 0
    with np.load(tmp_path / f"{name}.npz", allow_pickle=False) as data:
        for key in ("depth_sd_mm", "slope_sd", "depth_model_sd_mm", "slope_model_sd"):
            assert data[key].shape == data["depth_mm"].shape
            assert data[key].dtype == np.float32
        assert 0.0 < float(data["depth_scale_sd"]) < 0.03


def test_the_evaluation_measures_every_press_of_the_folder(
    session: Path, calibration: Path, press: Path, tmp_path: Path
) -> None:
    presses = tmp_path / "presses"
    presses.mkdir()
    for name in (press.name, "cuboid_s4_d100.png"):
        shutil.copy(session / "presses" / name, presses)
    rows = (session / "presses" / "truth.csv").read_text().splitlines()
    kept = [rows[0], *(r for r in rows if r.startswith(("cylinder_s5_d100", "cuboid_s4_d100")))]
    (presses / "truth.csv").write_text("\n".join(kept) + "\n")
    assert main(["evaluate", str(calibration), str(presses), "-o", str(tmp_path / "e")]) == 0
    assert {"evaluation.csv", "evaluation.json", "evaluation.png", "evaluation.txt"} == {
        p.name for p in (tmp_path / "e").iterdir()
    }
    assert cv2.imread(str(tmp_path / "e" / "evaluation.png")) is not None


def test_an_evaluation_of_which_nothing_could_be_measured_is_refused(
    session: Path, calibration: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    presses = tmp_path / "presses"
    presses.mkdir()
    shutil.copy(next((session / "background").iterdir()), presses / "bare.png")
    head = "file,shape,diameter_mm,side_mm,height_mm"
    (presses / "truth.csv").write_text(f"{head}\nbare.png,cylinder,5.0,,1.0\n")
    line = refusal(capsys, "evaluate", str(calibration), str(presses), "-o", str(tmp_path / "e"))
    assert "none of the 1 presses" in line


def test_the_benchmark_says_where_the_time_goes(
    calibration: Path, press: Path, tmp_path: Path
) -> None:
    result = tmp_path / "b.json"
    arguments = ["benchmark", str(calibration), str(press), "--json", str(result)]
    assert main([*arguments, "--repeats", "2"]) == 0
    timing = json.loads(result.read_text())
    assert {"total_ms", "copy_floor_ms", "steps", "threads", "model", "plan"} <= set(timing)
    assert {"name", "median_ms", "p95_ms", "bytes"} <= set(timing["steps"][0])


def test_a_design_is_checked_from_its_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "d.toml").write_text("")
    figure = tmp_path / "shadows.png"
    assert main(["design", str(tmp_path / "d.toml"), "--shadows", str(figure)]) == 0
    shown = capsys.readouterr().out
    assert "design" in shown
    assert "directional" in shown
    assert "pixel (" in shown
    assert cv2.imread(str(figure)) is not None
    (tmp_path / "bad.toml").write_text("nonsense = 1\n")
    assert "nonsense" in refusal(capsys, "design", str(tmp_path / "bad.toml"))


def damaged(session: Path, tmp_path: Path, damage: Callable[[Path], None]) -> Path:
    """Return a copy of the session with one thing made wrong."""
    copy = tmp_path / "copy"
    shutil.copytree(session, copy, ignore=shutil.ignore_patterns("presses", "truth"))
    damage(copy)
    return copy


def paint(path: Path, change: Callable[[np.ndarray], np.ndarray]) -> None:
    """Rewrite a picture after a change of its (rows, columns, 3) uint8 values, BGR."""
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
    assert cv2.imwrite(str(path), np.asarray(change(picture), np.uint8))


def replace_text(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def two_presses(folder: Path) -> None:
    """Put the halves of two pictures together whose balls lie in different halves."""
    pictures = sorted((folder / "balls").glob("*.png"))
    truth = json.loads((folder / "truth.json").read_text())["balls"]
    x = [b["centre_sensor_xy_mm"][0] for b in truth]
    left, right = int(np.argmin(x)), int(np.argmax(x))
    first, second = (cv2.imread(str(pictures[k])) for k in (left, right))
    middle = first.shape[1] // 2
    first[:, middle:] = second[:, middle:]
    assert cv2.imwrite(str(pictures[0]), first)


DAMAGES: list[tuple[str, Callable[[Path], None], str]] = [
    ("no mirror", lambda f: shutil.rmtree(f / "mirror"), "mirror: the stage has no pictures"),
    ("no background", lambda f: shutil.rmtree(f / "background"), "background"),
    (
        "another size",
        lambda f: paint(next((f / "whiteboard").iterdir()), lambda p: p[:-10]),
        "whiteboard",
    ),
    (
        "grey",
        lambda f: paint(
            next((f / "background").iterdir()), lambda p: np.repeat(p[..., :1], 3, axis=2)
        ),
        "grey",
    ),
    ("black", lambda f: paint(next((f / "background").iterdir()), lambda p: p * 0), "dark"),
    (
        "saturated",
        lambda f: paint(
            next((f / "whiteboard").iterdir()), lambda p: np.minimum(p.astype(int) * 9, 255)
        ),
        "saturated",
    ),
    (
        "wrong board",
        lambda f: replace_text(f / "session.toml", "inner_corners = [", "inner_corners = [1"),
        "views",
    ),
    ("two presses", two_presses, "more than one|2 |two"),
    (
        "ball too small",
        lambda f: replace_text(f / "session.toml", '.png" = 3.0', '.png" = 0.9'),
        "radius",
    ),
    (
        "unknown key",
        lambda f: replace_text(f / "session.toml", "[sensor]", "[sensor]\ncolour = 1"),
        "colour",
    ),
    ("future", lambda f: replace_text(f / "session.toml", "version = 1", "version = 3"), "newer"),
    (
        "copied stage",
        lambda f: shutil.copy(
            next((f / "background").iterdir()), next((f / "whiteboard").iterdir())
        ),
        "copy of whiteboard",
    ),
    (
        "working diameter",
        lambda f: replace_text(
            f / "session.toml", "working_diameter_mm = 26.0", "working_diameter_mm = 1.0"
        ),
        "working_diameter_mm",
    ),
    (
        "no picture",
        lambda f: next((f / "mirror").iterdir()).write_bytes(b"\x89PNG broken"),
        "not a whole",
    ),
]


@pytest.mark.parametrize(("damage", "what"), [d[1:] for d in DAMAGES], ids=[d[0] for d in DAMAGES])
def test_a_session_with_a_fault_is_refused_in_one_line_and_nothing_is_written(
    session: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    damage: Callable[[Path], None],
    what: str,
) -> None:
    import re

    folder = damaged(session, tmp_path, damage)
    output = tmp_path / "c.gplcal"
    line = refusal(capsys, "calibrate", str(folder), "-o", str(output))
    assert re.search(what, line), line
    assert not output.exists()
    assert not list(tmp_path.glob(".*"))


def test_what_is_wrong_on_the_command_line_is_said(
    session: Path,
    calibration: Path,
    press: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    cal, out = str(calibration), str(tmp_path / "o")
    assert "session.toml" in refusal(capsys, "calibrate", str(tmp_path), "-o", out)
    nowhere = str(tmp_path / "no" / "c.gplcal")
    assert "folder" in refusal(capsys, "calibrate", str(session), "-o", nowhere)
    assert "no such file" in refusal(capsys, "inspect", str(tmp_path / "none.gplcal"))
    assert "no such file" in refusal(capsys, "reconstruct", cal, str(tmp_path / "x.png"), "-o", out)
    assert "xyz" in refusal(capsys, "reconstruct", cal, str(press), "-o", out, "--format", "xyz")
    twice = ("reconstruct", cal, str(press), str(press), "-o", out)
    assert "two pictures" in refusal(capsys, *twice)
    other = tmp_path / "small.png"
    assert cv2.imwrite(str(other), np.dstack([np.full((9, 9), k, np.uint8) for k in (9, 8, 7)]))
    assert "9x9" in refusal(capsys, "reconstruct", cal, str(other), "-o", out)
    bare = next((session / "background").iterdir())
    nothing = refusal(capsys, "measure", cal, str(bare), "--shape", "ball")
    assert "pressed" in nothing or "nothing" in nothing
    cut = tmp_path / "cut.gplcal"
    cut.write_bytes(calibration.read_bytes()[:-500])
    assert "damaged" in refusal(capsys, "inspect", str(cut))


def test_no_result_takes_the_place_of_what_it_is_made_of(
    session: Path,
    calibration: Path,
    press: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A slip of the hand costs a line of text, not the capture or the calibration."""
    picture, cal = tmp_path / "p.png", tmp_path / "c.gplcal"
    shutil.copy(press, picture)
    shutil.copy(calibration, cal)
    (tmp_path / "link.gplcal").symlink_to(cal)
    (tmp_path / "d.toml").write_text("")
    ball = session / "balls" / "ball_00.png"
    kept = [path.read_bytes() for path in (picture, cal, ball)]
    measure = ("measure", str(cal), str(picture), "--shape", "ball", "--json")
    both = ("-o", str(tmp_path / "x"), "--json", str(tmp_path / "x"))
    for arguments in (
        ("reconstruct", str(cal), str(picture), "-o", str(tmp_path), "--pictures"),
        (*measure, str(cal)),
        (*measure, str(picture)),
        (*measure, str(tmp_path / "link.gplcal")),
        ("benchmark", str(cal), str(picture), "--json", str(cal)),
        ("calibrate", str(session), "-o", str(ball)),
        ("calibrate", str(session), *both),
        ("design", str(tmp_path / "d.toml"), "--shadows", str(tmp_path / "d.toml")),
    ):
        assert "take the place" in refusal(capsys, *arguments)
    assert [path.read_bytes() for path in (picture, cal, ball)] == kept
    assert not (tmp_path / "x").exists()


def test_what_the_system_refuses_is_a_sentence(
    calibration: Path, press: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    long = "x" * 300
    assert "too long" in refusal(capsys, "inspect", str(tmp_path / long))
    assert "too long" in refusal(capsys, "simulate", str(tmp_path / long))
    inside = str(press / "session")
    assert "a file stands" in refusal(capsys, "simulate", inside)
    (tmp_path / "d.toml").write_text("")
    shadows = ("design", str(tmp_path / "d.toml"), "--shadows", str(tmp_path))
    assert "a folder stands" in refusal(capsys, *shadows)
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
def test_a_slip_in_the_arguments_is_one_line(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], what: str
) -> None:
    with pytest.raises(SystemExit) as left:
        main(arguments)
    assert left.value.code == MENDABLE
    (line,) = capsys.readouterr().err.splitlines()
    assert what in line
    assert "--help" in line


def test_ctrl_c_while_the_program_loads_is_answered(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(main_module, "build_parser", interrupt)
    assert main(["inspect", "c"]) == main_module.INTERRUPTED
    assert capsys.readouterr().err == "gelpolight: stopped\n"


def test_a_log_that_cannot_be_written_shows_no_traceback(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "file"))

    def fail(_path: Path) -> None:
        raise ZeroDivisionError("the tests did it")

    monkeypatch.setattr(calibrate, "read_session", fail)
    assert main(["calibrate", str(tmp_path), "-o", str(tmp_path / "c.gplcal")]) == OUR_FAULT
    (line,) = capsys.readouterr().err.splitlines()
    assert "the tests did it" in line


def test_names_that_differ_only_in_case_are_one_name(
    calibration: Path, press: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """On many disks the second depth map would take the place of the first."""
    shutil.copy(press, tmp_path / "A.png")
    shutil.copy(press, tmp_path / "a.tif")
    twins = (str(tmp_path / "A.png"), str(tmp_path / "a.tif"))
    assert "two pictures" in refusal(
        capsys, "reconstruct", str(calibration), *twins, "-o", str(tmp_path / "o")
    )


def test_a_closed_output_is_no_fault(calibration: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "stderr", None)
    assert main(["inspect", str(calibration)]) == 0
    for stream in (sys.stdout, sys.stderr):
        stream.close()


def test_warnings_of_libraries_go_to_the_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))

    def warn(_path: Path) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            # pytest puts its own recorder in the place of what main set
            warnings.showwarning = main_module._log_warning
            warnings.warn("divide by zero", RuntimeWarning, stacklevel=1)
        raise InputError("stop", where="here", advice="Do")

    monkeypatch.setattr(calibrate, "read_session", warn)
    assert main(["calibrate", str(tmp_path), "-o", str(tmp_path / "c.gplcal")]) == MENDABLE
    assert "divide" not in capsys.readouterr().err
    assert "divide by zero" in next(tmp_path.rglob("gelpolight-faults.log")).read_text()


def test_a_full_disk_is_a_sentence(
    session: Path, capsys: pytest.CaptureFixture[str], calibration: Path
) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("this system has no /dev/full")
    background = str(next((session / "background").iterdir()))
    arguments = ("reconstruct", str(calibration), background, "-o", "/dev/full")
    assert "/dev/full" in refusal(capsys, *arguments)


def test_a_fault_of_ours_is_one_line_and_a_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))

    def fail(_path: Path) -> None:
        raise ZeroDivisionError("the tests did it")

    monkeypatch.setattr(calibrate, "read_session", fail)
    assert main(["calibrate", str(tmp_path), "-o", str(tmp_path / "c.gplcal")]) == OUR_FAULT
    said = capsys.readouterr().err
    assert "the tests did it" in said
    assert "Traceback" not in said
    log = next(tmp_path.rglob("gelpolight-faults.log"))
    assert "Traceback" in log.read_text()


def test_help_lists_the_commands(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    shown = capsys.readouterr().out
    for command in ("simulate", "calibrate", "reconstruct", "measure", "evaluate", "--demo"):
        assert command in shown
