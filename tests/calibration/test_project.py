"""A calibration being made: nothing is lost, out-of-date results are known, corrections work."""

import errno
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.open_ball_stages import BALLS, BallsStageResult
from gelpolight_core.calibration.open_sensor_recipe import LENS
from gelpolight_core.calibration.project import CalibrationProject, Cancelled
from gelpolight_core.calibration.recipe import StageContext
from gelpolight_core.calibration.stage_status import StageState
from gelpolight_core.session.decisions import PlacedCircle
from gelpolight_core.session.description import create_session
from gelpolight_core.session.session import read_session


@pytest.fixture
def project(computed_project):
    """Return a computed project in its own folder."""
    return computed_project()


def test_a_change_makes_stale_what_rests_on_it_and_nothing_else(project):
    project.exclude("balls", project.session.found("balls")[0].name)
    states = {stage: status.state for stage, status in project.statuses().items()}
    late = {"balls", "reflectance", "joint"}
    assert {s for s, state in states.items() if state is StageState.STALE} == late
    assert project.stale() == ("balls", "reflectance", "joint")
    assert "excluded" in project.statuses()["balls"].sentence
    sensor = replace(project.session.sensor, led_height_mm=15.0)
    project.describe(replace(project.session, sensor=sensor))
    stale = set(project.stale())
    assert {"lights", "joint"} < stale
    assert "top_pose" not in stale
    assert read_session(project.session.folder).sensor.led_height_mm == 15.0


def test_captures_and_decisions_are_on_disk_at_once(project):
    frames = [np.full((240, 320, 3), value, np.uint8) for value in (10, 13)]
    name = project.add_capture("balls", frames)
    project.set_ball_radius(name, 2.5)
    project.place_ball(name, PlacedCircle(320.5, 200.25, 40.0))
    project.place_spot(1, (100.25, 50.5))
    other = CalibrationProject(project.session.folder)
    assert other.session == project.session
    raw = cv2.imread(str(other.session.folder / "balls" / name), cv2.IMREAD_UNCHANGED)
    assert raw.dtype == np.uint16
    assert np.all(raw == round(11.5 * 257))


def test_a_capture_and_an_import_see_what_another_program_did_to_the_folder(
    small_session, tmp_path
):
    create_session(replace(read_session(small_session), folder=tmp_path / "session"))
    project = CalibrationProject(tmp_path / "session")
    first = [np.full((48, 64, 3), 9, np.uint8)]
    folder = project.session.folder / "balls"
    (folder / project.add_capture("balls", first)).unlink()
    project.add_capture("background", [np.full((60, 80, 3), 7, np.uint8)])  # of another size
    outside = tmp_path / "outside.png"
    assert cv2.imwrite(str(outside), np.full((60, 80, 3), (5, 60, 90), np.uint8))
    project.statuses()
    (folder / "copied.png").write_bytes(outside.read_bytes())

    with pytest.raises(InputError, match=r"already in the session, as balls/copied\.png"):
        project.import_files("balls", [outside])


def test_a_new_capture_of_a_single_view_replaces_the_former(project):
    before = project.session.captured("mirror")
    name = project.add_capture("lights", [np.zeros((240, 320, 3), np.uint8)])
    assert [p.name for p in project.session.found("mirror")] == [name]
    assert all(path.is_file() for path in before)
    project.exclude("lights", name)
    assert project.add_capture("lights", [np.zeros((240, 320, 3), np.uint8)]) != name


def test_a_failing_stage_keeps_its_reason_and_the_results_of_others(project):
    project.add_capture("lights", [np.zeros((240, 320, 3), np.uint8)])
    status = project.compute("lights")
    assert status.state is StageState.FAIL
    assert "black" in status.sentence
    assert project.results.get(LENS) is not None
    assert "radiance" not in project.stale()
    assert project.statuses()["radiance"].state is StageState.STALE


@pytest.mark.function("Stop a computation")
def test_a_computation_can_be_stopped_and_leaves_all_as_it_was(project):
    project.set_ball_radius(project.session.found("balls")[0].name, 2.9)

    def stop(_share: float) -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        project.compute("balls", stop)
    assert project.statuses()["balls"].state is StageState.STALE
    assert project.compute("balls").state is not StageState.STALE


def test_an_unfinished_session_says_which_stage_is_open(small_session, tmp_path):
    session = read_session(small_session)
    create_session(replace(session, folder=tmp_path / "new"))
    project = CalibrationProject(tmp_path / "new")
    # The camera response needs no images: it may be declared, or is assumed to be linear.
    assert project.stale() == ("response",)
    project.compute("response")
    assert project.stale() == ()
    states = {stage: status.state for stage, status in project.statuses().items()}
    assert states.pop("response") is StageState.PASS
    assert set(states.values()) == {StageState.EMPTY}
    with pytest.raises(InputError, match="lens has no up-to-date result"):
        project.finish()
    with pytest.raises(InputError, match="already contains a session"):
        create_session(replace(session, folder=tmp_path / "new"))


def test_what_somebody_else_wrote_into_the_session_is_not_written_over(project):
    path = project.session.folder / "session.toml"
    path.write_text(path.read_text().replace("led_height_mm = 13.7", "led_height_mm = 13.9"))
    written = path.read_bytes()
    with pytest.raises(InputError, match=r"session\.toml.*Another program"):
        project.set_ball_radius("ball_01.png", 3.5)
    assert path.read_bytes() == written
    project.exclude("balls", "ball_02.png")  # the other file is unchanged
    again = CalibrationProject(path.parent)
    assert again.session.sensor.led_height_mm == 13.9
    again.set_ball_radius("ball_01.png", 3.5)
    assert read_session(path.parent).sensor.led_height_mm == 13.9


def test_an_image_that_another_program_adds_or_changes_is_noticed(project):
    first = project.session.found("balls")[0]
    image = np.roll(cv2.imread(str(first)), 1, axis=0)
    added = first.with_name("ball_900.png")
    cv2.imwrite(str(added), image)
    assert "ball_900.png added" in project.statuses()["balls"].sentence
    assert added in project.session.found("balls")
    added.unlink()
    assert project.statuses()["balls"].state is not StageState.STALE
    cv2.imwrite(str(first), image)
    assert f"{first.name} changed" in project.statuses()["balls"].sentence


def test_a_single_view_that_cannot_replace_the_former_is_not_stored(project):
    """Two used images would be averaged."""
    project.exclude("balls", project.session.found("balls")[0].name)
    decisions = project.session.folder / "decisions.toml"
    decisions.write_text(decisions.read_text() + "# by another program\n")
    before = project.session.captured("whiteboard")
    with pytest.raises(InputError, match="nothing was written"):
        project.add_capture("radiance", [np.full((240, 320, 3), 90, np.uint8)])
    assert read_session(project.session.folder).captured("whiteboard") == before


def test_an_import_that_the_disk_ends_leaves_nothing_behind(project, tmp_path, monkeypatch):
    before, files = project.session, []
    press = cv2.imread(str(before.found("balls")[0]))
    for number in range(3):
        files.append(tmp_path / f"press{number}.png")
        cv2.imwrite(str(files[-1]), np.roll(press, number + 1, axis=0))
    third = f"{len(before.captured('balls')) + 3:03d}.png"

    def full_after_two(move: Callable[..., None]) -> Callable[..., None]:
        def moved(source: Path, target: Path) -> None:
            if str(target).endswith(third):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            move(source, target)

        return moved

    for name in ("link", "replace"):
        monkeypatch.setattr(os, name, full_after_two(getattr(os, name)))
    with pytest.raises(InputError, match="The disk is full"):
        project.import_files("balls", files, radius_mm=2.5)
    monkeypatch.undo()
    assert read_session(before.folder) == before == project.session
    assert len(project.import_files("balls", files, radius_mm=2.5)) == 3


def test_a_press_captured_during_a_computation_belongs_to_the_next_one(project, monkeypatch):
    captured: list[str] = []

    def slow(work: StageContext) -> BallsStageResult:
        frame = cv2.imread(str(work.session.found("balls")[0]))[..., ::-1]
        captured.append(project.add_capture("balls", [frame], radius_mm=3.0))
        return BALLS.run(work)

    before = project.recipe
    slowly = tuple(replace(s, run=slow) if s is BALLS else s for s in before.stages)
    monkeypatch.setattr(project, "recipe", replace(before, stages=slowly))
    project.set_ball_radius(project.session.found("balls")[0].name, 3.01)
    project.compute("balls")
    monkeypatch.undo()
    assert captured
    assert project.statuses()["balls"].state is StageState.STALE
    assert project.compute("balls").state in (StageState.PASS, StageState.WARN)
