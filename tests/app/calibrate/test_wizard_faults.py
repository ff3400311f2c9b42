"""Mistakes of the technician and failures of the system: the page says what to do."""

import errno
import os
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from technician import read_rgb


def test_a_stopped_camera_is_reported_and_can_be_reconnected(
    technician, camera, computed_project, small_session
):
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


def test_an_aborted_capture_is_reported(technician, camera, computed_project, context):
    """The camera shows no image yet, so the frames of a capture cannot arrive."""
    page = technician.page
    context.toasts.attach(page, lambda: None)
    technician.begin(computed_project(), "background")
    wizard, live = technician.wizard, technician.wizard.model.live
    for leave in (lambda: wizard.go_to("result"), page.leave, page.leave_session):
        page.enter()
        wizard.go_to("background")
        technician.click("calibrate.capture")
        assert live.capturing
        leave()
        assert not live.capturing
        assert ["not captured" in toast.text for toast in context.toasts.shown()] == [True]
        context.toasts.clear()


def test_a_wrong_image_fails_with_advice_and_can_be_captured_again(
    technician, camera, computed_project, small_session
):
    technician.begin(computed_project(), "lights")
    wizard, panel = technician.wizard, technician.wizard.panel
    bare = read_rgb(small_session / "background" / "background.png")
    for step, shown, words, state in (
        ("balls", bare, "left out", "warn"),  # the other presses are still used
        ("lights", np.zeros_like(bare), "black", "fail"),
    ):
        wizard.go_to(step)
        camera.show(shown)
        technician.until(panel.live.text)
        technician.capture()
        technician.rest()
        assert technician.state(step) == state
        sentence = panel.sentence.text()
        assert words in sentence.lower()
        assert len(sentence.split(". ")) >= 2, "it says what was found and what to do"
        finished = state == "warn" and wizard.open.count() >= wizard.open.wanted
        assert wizard.model.page.finished is finished
        assert panel.capture.isEnabled()


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


@pytest.mark.function("Import image files into a step")
def test_only_good_files_are_imported_with_the_shown_diameter(
    technician, computed_project, tmp_path
):
    project = computed_project()
    technician.begin(project, "balls")
    wizard, before = technician.wizard, project.session.captured("balls")
    files = wrong_files(project.session.folder, tmp_path / "wrong")
    for kind, words in (
        ("grey", "grey"), ("size", "160x120"), ("copy", "already"), ("torn", "complete"),
        ("text", "not an image"),
    ):  # fmt: skip
        wizard.open.import_files([files[kind]])
        technician.rest()
        assert words in wizard.panel.notice.text()
        assert project.session.captured("balls") == before
        assert project.stale() == ()
    ball = cv2.imread(str(before[0]), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(tmp_path / "another.png"), np.where(ball > 0, ball - 1, 0).astype(ball.dtype))
    wizard.at("balls").radius.setValue(7.0)
    wizard.open.import_files([tmp_path / "another.png"])
    technician.rest()
    (imported,) = set(project.session.captured("balls")) - set(before)
    assert project.session.ball_radii_mm[imported.name] == 3.5


def full_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make every file operation fail, as on a full disk."""

    def refuse(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    for name in ("os.replace", "_place_new"):
        monkeypatch.setattr(f"gelpolight_core.base.atomic_write.{name}", refuse)


def test_a_full_disk_is_reported_and_partial_files_are_ignored(
    technician, camera, computed_project, small_session, tmp_path, monkeypatch, caplog
):
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
    # An image that cannot be saved when the session is closed is reported, too.
    press = cv2.imread(str(project.session.found("balls")[0]))
    cv2.imwrite(str(tmp_path / "press.png"), np.roll(press, 1, axis=0))
    full_disk(monkeypatch)
    caplog.clear()
    technician.wizard.model.import_files("balls", [tmp_path / "press.png"])
    technician.page.leave_session()
    assert "disk is full" in caplog.text
    monkeypatch.undo()


def test_damaged_and_deleted_files_of_a_session_are_named(technician, computed_project):
    project = computed_project()
    folder, path = project.session.folder, project.session.found("balls")[0]
    for name in ("session.toml", "decisions.toml"):
        whole = (folder / name).read_bytes() if (folder / name).exists() else None
        (folder / name).write_text("[[[ broken")
        technician.page.open_path(folder)
        assert technician.page.wizard is None
        assert name in technician.see("question.problem").text()
        if whole is None:
            (folder / name).unlink()
        else:
            (folder / name).write_bytes(whole)
    technician.begin(project, "balls")
    path.unlink()
    technician.wizard.show_capture(path.name)
    assert path.name in technician.wizard.panel.notice.text()
    technician.wizard.go_to("balls")
    assert technician.state("balls") == "stale"
    technician.rest()
