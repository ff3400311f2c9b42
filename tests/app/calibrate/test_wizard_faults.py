"""Mistakes of the technician and failures of the system: the page says what to do."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from technician import ScriptedCamera, Technician, read_rgb

from app.context.context import AppContext
from gelpolight_core.calibration.project import Project

Made = Callable[[], Project]


def test_a_stopped_camera_is_reported_and_can_be_reconnected(
    technician: Technician, camera: ScriptedCamera, computed_project: Made, small_session: Path
) -> None:
    technician.begin(computed_project(), "balls")
    camera.show(read_rgb(small_session / "balls" / "ball_01.png"))
    technician.until(lambda: "Ball found" in technician.wizard.panel.live.text())
    camera.broken = True
    technician.until(technician.wizard.area.lost.isVisible)
    assert "Check its cable" in technician.wizard.area.why.text()
    technician.click("calibrate.capture")
    technician.until(lambda: "unplugged" in technician.wizard.panel.notice.text())
    camera.broken = False
    technician.click("calibrate.reconnect")
    technician.until(lambda: not technician.wizard.area.lost.isVisible())
    technician.capture()
    technician.rest()


@pytest.mark.parametrize(
    "leave",
    [
        pytest.param(lambda one: one.wizard.go_to("result"), id="step"),
        pytest.param(lambda one: one.page.leave(), id="page"),
        pytest.param(lambda one: one.page.leave_session(), id="session"),
    ],
)
def test_an_aborted_capture_is_reported(
    technician: Technician, camera: ScriptedCamera, computed_project: Made, context: AppContext,
    leave: Callable[[Technician], None],
) -> None:  # fmt: skip
    """The camera shows no image yet, so the frames of a capture cannot arrive."""
    context.toasts.attach(technician.page, lambda: None)
    technician.begin(computed_project(), "background")
    controller = technician.wizard.model
    technician.click("calibrate.capture")
    assert controller.live.capturing
    leave(technician)
    assert not controller.live.capturing
    assert ["not captured" in toast.text for toast in context.toasts.shown()] == [True]
    context.toasts.clear()


@pytest.mark.parametrize(
    ("step", "shown", "expected_text", "state"),
    [
        pytest.param("lights", "background/background.png", "", "fail", id="membrane left on"),
        pytest.param("lights", "black", "black", "fail", id="lens cap on"),
        pytest.param("radiance", "bright", "exposure", "fail", id="far too much light"),
        # The other presses are still used.
        pytest.param(
            "balls", "background/background.png", "Left out", "warn", id="nothing pressed in"
        ),
    ],
)
def test_a_wrong_image_fails_with_advice_and_can_be_captured_again(
    technician: Technician, camera: ScriptedCamera, computed_project: Made, small_session: Path,
    step: str, shown: str, expected_text: str, state: str,
) -> None:  # fmt: skip
    technician.begin(computed_project(), step)
    bare = read_rgb(small_session / "background" / "background.png")
    full = np.iinfo(bare.dtype).max
    images = {"black": np.zeros_like(bare), "bright": np.full_like(bare, full)}
    camera.show(images[shown] if shown in images else read_rgb(small_session / shown))
    technician.until(lambda: technician.wizard.panel.live.text())
    technician.capture()
    technician.rest()
    panel = technician.wizard.panel
    assert technician.state(step) == state
    sentence = panel.sentence.text()
    assert expected_text.lower() in sentence.lower()
    assert len(sentence.split(". ")) >= 2, "it says what was found and what to do"
    opened = technician.wizard.open
    assert technician.wizard.model.page.finished is (
        state == "warn" and opened.count() >= opened.wanted
    )
    assert panel.capture.isEnabled()


def test_a_wrong_ball_radius_changes_the_figures(
    technician: Technician, computed_project: Made
) -> None:
    """Half the radius means twice the curvature: the shading does not fit any more."""
    project = computed_project()
    technician.begin(project, "balls")
    name = project.session.found("balls")[0].name
    technician.wizard.show_capture(name)
    technician.wizard.at("balls").radius.setValue(project.session.ball_radius_mm(name))
    technician.rest()
    assert technician.state("balls") in ("warn", "fail")
    assert "radius" in technician.wizard.panel.sentence.text().lower()


def wrong_files(session: Path, folder: Path) -> dict[str, Path]:
    """Return image files that are not valid ball images of the session."""
    folder.mkdir()
    ball = read_rgb(session / "balls" / "ball_01.png")
    files = {name: folder / f"{name}.png" for name in ("grey", "size", "copy", "torn", "text")}
    cv2.imwrite(str(files["grey"]), ball[..., 1])
    cv2.imwrite(str(files["size"]), ball[::2, ::2])
    shutil.copy(session / "balls" / "ball_02.png", files["copy"])
    files["torn"].write_bytes((session / "balls" / "ball_03.png").read_bytes()[:-300])
    files["text"].write_text("no image")
    return files


@pytest.mark.parametrize(
    ("kind", "expected_text"),
    [("grey", "grey"), ("size", "160x120"), ("copy", "already"), ("torn", "complete"),
     ("text", "not an image")],
)  # fmt: skip
def test_an_invalid_file_is_not_imported(
    technician: Technician, computed_project: Made, tmp_path: Path, kind: str, expected_text: str
) -> None:
    project = computed_project()
    technician.begin(project, "balls")
    before = project.session.captured("balls")
    file = wrong_files(project.session.folder, tmp_path / "wrong")[kind]
    technician.wizard.open.import_files([file])
    technician.rest()
    assert expected_text in technician.wizard.panel.notice.text()
    assert project.session.captured("balls") == before
    assert project.stale() == ()


def test_good_files_are_imported_with_the_shown_radius(
    technician: Technician, computed_project: Made, small_session: Path, tmp_path: Path
) -> None:
    project = computed_project()
    technician.begin(project, "balls")
    shown = read_rgb(small_session / "balls" / "ball_01.png").astype(np.int64)
    file = tmp_path / "another.png"
    cv2.imwrite(str(file), np.clip(shown - 1, 0, None).astype(np.uint16)[..., ::-1])
    if read_rgb(small_session / "balls" / "ball_01.png").dtype == np.uint8:
        cv2.imwrite(str(file), np.clip(shown - 1, 0, None).astype(np.uint8)[..., ::-1])
    technician.wizard.at("balls").radius.setValue(7.0)
    before = set(project.session.captured("balls"))
    technician.wizard.open.import_files([file])
    technician.rest()
    (imported,) = set(project.session.captured("balls")) - before
    assert project.session.ball_radii_mm[imported.name] == 3.5


def full_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make every file operation fail, as on a full disk."""

    def refuse(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    for name in ("os.replace", "_place_new"):
        monkeypatch.setattr(f"gelpolight_core.io.atomic.{name}", refuse)


def test_a_full_disk_is_reported_and_partial_files_are_ignored(
    technician: Technician, camera: ScriptedCamera, computed_project: Made, small_session: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    project = computed_project()
    technician.begin(project, "background")
    camera.show(read_rgb(small_session / "background" / "background.png"))
    technician.until(lambda: technician.wizard.panel.live.text())
    before = sorted(project.session.folder.rglob("*"))
    full_disk(monkeypatch)
    technician.click("calibrate.capture")
    technician.until(lambda: "disk is full" in technician.wizard.panel.notice.text())
    technician.rest()
    assert sorted(project.session.folder.rglob("*")) == before
    technician.wizard.model.exclude("balls", "ball_01.png", True)
    assert technician.wizard.model.undo.count() == 0
    assert "disk is full" in technician.wizard.panel.notice.text()
    assert project.session.decisions.excluded == frozenset()
    monkeypatch.undo()
    technician.capture()
    technician.rest()


def test_an_unsaved_image_is_reported_after_the_session_is_closed(
    technician: Technician, computed_project: Made, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture,
) -> None:  # fmt: skip
    project = computed_project()
    technician.begin(project, "balls")
    press = cv2.imread(str(project.session.found("balls")[0]))
    cv2.imwrite(str(tmp_path / "press.png"), np.roll(press, 1, axis=0))
    full_disk(monkeypatch)
    technician.wizard.model.import_files("balls", [tmp_path / "press.png"])
    technician.page.leave_session()
    assert "disk is full" in caplog.text
    monkeypatch.undo()
    technician.begin(project, "balls")


@pytest.mark.parametrize("name", ["session.toml", "decisions.toml"])
def test_a_damaged_file_is_named_when_the_session_is_opened(
    technician: Technician, computed_project: Made, context: AppContext, name: str
) -> None:
    project = computed_project()
    folder = project.session.folder
    (folder / name).write_text("[[[ broken")
    technician.page.open_path(folder)
    assert technician.page.wizard is None
    problem = technician.see("start.problem")
    assert name in problem.text()


def test_an_image_deleted_by_hand_causes_no_internal_error(
    technician: Technician, computed_project: Made
) -> None:
    project = computed_project()
    technician.begin(project, "balls")
    path = project.session.found("balls")[0]
    path.unlink()
    technician.wizard.show_capture(path.name)
    assert path.name in technician.wizard.panel.notice.text()
    technician.wizard.go_to("balls")
    assert technician.state("balls") == "stale"
    technician.rest()
