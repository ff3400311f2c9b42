"""What a technician relies on in the wizard."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from technician import ScriptedCamera, Technician, read_rgb

from app.calibrate.reflectance.curves import Curves
from app.context.context import AppContext
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.calibration.manifest import read_summary
from gelpolight_core.calibration.open_sensor import LIGHTS, TOP_POSE
from gelpolight_core.calibration.project import Project
from gelpolight_core.finding import QualityTable, Verdict, judge
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.session import read_session

Made = Callable[[], Project]


def test_a_reported_capture_is_on_disk_with_its_radius(
    technician: Technician, camera: ScriptedCamera, computed_project: Made, small_session: Path
) -> None:
    technician.begin(computed_project(), "balls")
    camera.show(read_rgb(small_session / "balls" / "ball_01.png"))
    technician.wizard.at("balls").radius.setValue(5.0)
    name = technician.capture()
    kept = read_session(technician.session)
    assert kept.ball_radii_mm[name] == 2.5
    assert kept.image(technician.session / "balls" / name).size == (320, 240)
    technician.until(lambda: Path(name).stem in technician.wizard.area.verdict.title.text())


def test_a_typed_radius_is_kept_and_used_without_enter(
    technician: Technician, camera: ScriptedCamera, computed_project: Made, small_session: Path,
    qtbot: QtBot,
) -> None:  # fmt: skip
    technician.begin(computed_project(), "balls")
    camera.show(read_rgb(small_session / "balls" / "ball_01.png"))
    wizard, reported = technician.wizard, list[str]()
    wizard.model.captured.connect(lambda _stage, name: reported.append(name))
    panel, radius = wizard.panel, wizard.at("balls").radius
    radius.setFocus()
    radius.selectAll()
    qtbot.keyClicks(radius, "8")
    wizard.model.changed.emit()
    assert radius.cleanText() == "8"
    panel.automatic.setChecked(True)
    wizard.open.capture_by_itself()
    assert not wizard.model.live.capturing  # the number may be incomplete
    panel.automatic.setChecked(False)
    qtbot.keyClick(radius, Qt.Key.Key_F5)
    technician.until(lambda: reported)
    assert read_session(technician.session).ball_radii_mm[reported[0]] == 4.0
    technician.rest()


def test_captures_do_not_wait_for_a_computation(
    technician: Technician, camera: ScriptedCamera, fresh: Project, small_session: Path
) -> None:
    technician.begin(fresh, "lens")
    views = sorted((small_session / "checkerboard").glob("*.png"))[:3]
    release: list[bool] = []
    from app.services.jobs import Job

    def work(_progress: object) -> None:
        technician_waits.wait(60.0)

    technician_waits = threading.Event()
    technician.wizard.model.jobs.submit(Job("Long work", work, lambda _: release.append(True)))
    for number, view in enumerate(views, start=1):
        camera.show(read_rgb(view))
        technician.capture()
        assert len(fresh.session.captured("checkerboard")) == number
    assert not release
    technician_waits.set()
    technician.rest()


def test_capturing_again_makes_later_stages_stale_and_offers_recompute(
    technician: Technician, camera: ScriptedCamera, computed_project: Made, small_session: Path
) -> None:
    technician.begin(computed_project(), "radiance")
    assert technician.state("result") in ("pass", "warn")
    camera.show(read_rgb(small_session / "whiteboard" / "whiteboard.png"))
    technician.capture()
    technician.rest()
    assert technician.state("radiance") in ("pass", "warn")
    assert {technician.state(key) for key in ("balls", "result")} == {"stale"}
    assert technician.state("lights") == "warn", "small spots do not show the crosstalk"
    technician.wizard.go_to("balls")
    assert technician.wizard.panel.buttons[0].text() == "Recompute"
    technician.click("calibrate.remedy0")
    technician.rest()
    assert technician.state("balls") in ("pass", "warn")


def test_an_excluded_image_is_grey_and_undo_restores_it(
    technician: Technician, computed_project: Made, qtbot: QtBot
) -> None:
    technician.begin(computed_project(), "balls")
    strip = technician.wizard.area.strip
    name = strip.item(0).text().split("\n")[0] + ".png"
    strip.choose(name)
    qtbot.keyClick(strip, Qt.Key.Key_Delete)
    assert f"balls/{name}" in read_session(technician.session).decisions.excluded
    assert "excluded" in strip.item(0).text()
    qtbot.keyClick(technician.wizard, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    technician.rest()
    assert read_session(technician.session).decisions.excluded == frozenset()
    assert technician.wizard.project.stale() == ()


def test_a_capture_is_undone_in_order_and_can_be_redone(
    technician: Technician, camera: ScriptedCamera, computed_project: Made, small_session: Path
) -> None:
    """The earlier view is in use again, and no image file is ever deleted."""
    technician.begin(computed_project(), "lights")
    controller, project = technician.wizard.model, technician.wizard.project
    former = [path.name for path in project.session.found("mirror")]
    technician.wizard.at("lights").place_spot(1, (100.0, 90.0))
    controller.exclude("balls", "ball_02.png", True)
    technician.rest()
    camera.show(read_rgb(small_session / "mirror" / "mirror.png"))
    name = technician.capture()
    technician.rest()
    assert read_session(technician.session).decisions.spots_px == {}
    controller.undo.undo()
    session = read_session(technician.session)
    assert [path.name for path in session.found("mirror")] == former
    assert session.decisions.spots_px == {1: (100.0, 90.0)}
    assert "balls/ball_02.png" in session.decisions.excluded
    assert (technician.session / "mirror" / name).is_file()
    controller.undo.undo()
    assert "balls/ball_02.png" not in read_session(technician.session).decisions.excluded
    controller.undo.redo()
    controller.undo.redo()
    session = read_session(technician.session)
    assert [path.name for path in session.found("mirror")] == [name]
    assert session.decisions.spots_px == {}
    assert "balls/ball_02.png" in session.decisions.excluded
    technician.rest()


def test_a_manually_moved_spot_stays_until_undo(
    technician: Technician, computed_project: Made
) -> None:
    project = computed_project()
    technician.begin(project, "lights")
    panel, view = technician.wizard.panel, technician.wizard.area.view
    technician.wizard.show_capture(project.session.found("mirror")[0].name)
    technician.until(lambda: "found" in panel.live.text())
    u, v = project.results[LIGHTS].leds.spots.spots[1].centre_px
    view.moved.emit("mirror.1", u + 30.0, v + 20.0, 0.0)
    technician.until(lambda: "spot is dark" in panel.live.text())
    assert read_session(technician.session).decisions.spots_px[1] == (u + 30.0, v + 20.0)
    technician.until(lambda: technician.state("lights") == "fail")
    technician.wizard.model.undo.undo()
    technician.until(lambda: "spot is dark" not in panel.live.text())
    assert read_session(technician.session).decisions.spots_px == {}


def test_a_manually_moved_contact_is_used_and_reported(
    technician: Technician, computed_project: Made
) -> None:
    project = computed_project()
    technician.begin(project, "balls")
    panel = technician.wizard.panel
    name = project.session.found("balls")[0].name
    technician.wizard.show_capture(name)
    technician.until(lambda: "Ball found" in panel.live.text())
    technician.wizard.area.view.moved.emit("ball", 160.0, 120.0, 14.0)
    technician.until(lambda: "by hand" in panel.live.text())
    placed = read_session(technician.session).decisions.balls[name]
    assert (placed.u_px, placed.v_px, placed.radius_px) == (160.0, 120.0, 14.0)
    technician.wizard.model.undo.undo()
    technician.until(lambda: "Ball found" in panel.live.text())


def test_a_radius_corrected_on_a_capture_can_be_undone(
    technician: Technician, computed_project: Made
) -> None:
    project = computed_project()
    technician.begin(project, "balls")
    name = project.session.found("balls")[0].name
    before = project.session.ball_radius_mm(name)
    technician.wizard.show_capture(name)
    technician.wizard.at("balls").radius.setValue(2.0 * before + 1.0)
    assert read_session(technician.session).ball_radius_mm(name) == before + 0.5
    technician.wizard.model.undo.undo()
    assert read_session(technician.session).ball_radius_mm(name) == before
    assert technician.wizard.at("balls").radius_mm == before


def test_automatic_capture_waits_for_a_still_good_image_and_a_new_view(
    technician: Technician, camera: ScriptedCamera, fresh: Project, small_session: Path,
    qtbot: QtBot,
) -> None:  # fmt: skip
    first, second = sorted((small_session / "checkerboard").glob("*.png"))[:2]
    camera.show(np.full_like(read_rgb(first), 60))
    technician.begin(fresh, "lens")
    technician.wizard.panel.automatic.setChecked(True)
    qtbot.wait(700)
    assert not fresh.session.captured("checkerboard")
    camera.show(read_rgb(first))
    technician.until(lambda: len(fresh.session.captured("checkerboard")) == 1)
    qtbot.wait(2500)
    assert len(fresh.session.captured("checkerboard")) == 1
    camera.show(read_rgb(second))
    technician.until(lambda: len(fresh.session.captured("checkerboard")) == 2)
    technician.rest()


def test_the_saved_calibration_equals_that_of_the_command_line(
    technician: Technician, computed_project: Made, small_calibration: Calibration,
    tmp_path: Path,
) -> None:  # fmt: skip
    technician.begin(computed_project(), "result")
    technician.click("result.save")
    technician.rest()
    assert "Saved as" in technician.see("result.saved").text()
    (path,) = (tmp_path / "workspace" / "sensors").rglob("*.gplcal")
    made, theirs = read_calibration(path), small_calibration
    assert made.identity == theirs.identity
    assert made.data.full is not None
    assert theirs.data.full is not None
    for ours, others in (
        (made.data.radiance, theirs.data.radiance),
        (made.data.factors, theirs.data.factors),
        (made.data.led_positions_mm, theirs.data.led_positions_mm),
        (made.data.full.led_positions_mm, theirs.data.full.led_positions_mm),
        (made.data.full.background, theirs.data.full.background),
    ):
        np.testing.assert_array_equal(ours, others)


def test_a_failed_calibration_is_saved_as_a_draft_and_the_one_in_use_stays(
    technician: Technician, computed_project: Made, context: AppContext
) -> None:
    technician.begin(computed_project(), "result")
    technician.click("result.save")
    technician.rest()
    used = context.workspace.in_use
    assert used is not None
    project, step = technician.wizard.project, technician.wizard.at("result")
    results = project._results
    failed = QualityTable((judge("k", "Half a pixel", 0.5, "px", fail=0.3),))
    top = results[TOP_POSE]
    failed_top = replace(top, pose=replace(top.pose, quality=failed))
    project._results = results.having(TOP_POSE, failed_top)
    technician.wizard.refresh()
    assert step.overview.headline.property("meaning") == "fail"
    assert technician.state("result") == "fail"
    assert step.save.text() == "&Save as a draft"
    technician.click("result.save")
    technician.rest()
    (draft,) = context.workspace.sensors_folder.rglob("*-draft.gplcal")
    assert context.workspace.in_use == used
    assert read_summary(draft).verdict is Verdict.FAIL
    assert draft.stem in technician.wizard.panel.notice.text()
    assert not step.save.property("primary")


def test_a_recorded_trial_validates_and_is_found_when_the_session_is_opened_again(
    technician: Technician, camera: ScriptedCamera, computed_project: Made, small_session: Path
) -> None:
    technician.begin(computed_project(), "result")
    technician.click("result.save")
    technician.rest()
    technician.click("calibrate.next")
    camera.show(read_rgb(small_session / "presses" / "cylinder_s5_d100.png"))
    panel = technician.wizard.panel
    technician.until(panel.capture.isEnabled)
    technician.click("calibrate.capture")
    technician.until(lambda: "Diameter" in panel.notice.text())
    technician.click("validation.keep")
    assert technician.state("validation") == "pass"
    folder = technician.session
    technician.page.leave_session()
    technician.page.open_path(folder)
    technician.rest()
    assert technician.state("validation") == "pass"


def curves_of(technician: Technician, project: Project) -> Curves:
    """Open the curves of a project, and return them when their editor is there."""
    technician.begin(project, "result")
    step = technician.wizard.at("result")
    step.tabs.setCurrentIndex(2)
    technician.until(lambda: step.curves.editor is not None)
    # Shown later than made, and only then at work.
    technician.until(step.curves.editor.preview.isVisible)
    technician.rest()
    return step.curves


def test_where_it_was_saved_is_shown_until_the_captures_change(
    technician: Technician, computed_project: Made
) -> None:
    technician.begin(computed_project(), "result")
    wizard, step = technician.wizard, technician.wizard.at("result")
    step.overview.more.click()
    assert step.save.property("primary") and not wizard.panel.next.property("primary")
    technician.click("result.save")
    technician.rest()
    assert wizard.model.saved in step.saved.text()
    assert step.overview.every.isVisible(), "the figures stay open"
    assert not step.save.property("primary") and wizard.panel.next.property("primary")
    wizard.model.exclude("balls", "ball_01.png", True)
    wizard.model.jobs.cancel()
    technician.rest()
    assert not step.saved.text()


def test_curves_and_other_corrections_share_one_history(
    technician: Technician, computed_project: Made, qtbot: QtBot
) -> None:
    step = curves_of(technician, computed_project())
    editor, undo = step.editor, technician.wizard.model.undo
    fitted = editor.curves
    technician.click("lut.smooth")
    assert editor.curves != fitted
    assert set(read_session(technician.session).decisions.curves) == {0}
    technician.wizard.model.exclude("balls", "ball_01.png", True)
    assert undo.count() == 2
    undo.undo()
    assert set(read_session(technician.session).decisions.curves) == {0}
    assert read_session(technician.session).decisions.excluded == frozenset()
    technician.rest()
    qtbot.keyClick(technician.wizard, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert read_session(technician.session).decisions.curves == {}
    technician.rest()
    technician.until(lambda: step.editor is not None)
    assert step.editor.curves == fitted
    technician.until(step.editor.preview.isVisible)
    technician.rest()


def test_a_step_with_too_few_images_is_incomplete_not_failed(
    technician: Technician, camera: ScriptedCamera, fresh: Project, small_session: Path
) -> None:
    technician.begin(fresh, "lens")
    camera.show(read_rgb(sorted((small_session / "checkerboard").glob("*.png"))[0]))
    technician.capture()
    technician.rest()
    assert technician.state("lens") == "begun"
    assert technician.wizard.panel.below.text() == "1 of 12 captured"


def test_a_file_changed_by_another_program_is_reported_and_reloaded(
    technician: Technician, computed_project: Made
) -> None:
    technician.begin(computed_project(), "balls")
    wizard = technician.wizard
    path = technician.session / "decisions.toml"
    path.write_text(
        'format = "gelpolight-decisions"\nversion = 1\nexcluded = ["balls/ball_01.png"]'
    )
    (stage,) = wizard.open.stages
    wizard.model.exclude(stage, "ball_02.png", True)
    technician.until(lambda: "decisions.toml" in wizard.outside.sentence.text())
    technician.click("calibrate.outside.reload")
    technician.until(lambda: not wizard.outside.isVisible())
    wizard.model.exclude(stage, "ball_02.png", True)
    kept = {"balls/ball_01.png", "balls/ball_02.png"}
    technician.until(lambda: read_session(technician.session).decisions.excluded == kept)


def test_a_file_damaged_by_another_program_can_be_overwritten(
    technician: Technician, computed_project: Made
) -> None:
    technician.begin(computed_project(), "balls")
    wizard = technician.wizard
    (technician.session / "session.toml").write_text("broken = ")
    wizard.outside.check()
    technician.click("calibrate.outside.reload")
    assert "session.toml" in wizard.outside.sentence.text()
    technician.click("calibrate.outside.overwrite")
    assert not wizard.outside.isVisible()
    assert read_session(technician.session) == wizard.project.session


def test_a_press_image_is_validated_with_its_truth_file(
    technician: Technician, computed_project: Made, small_session: Path
) -> None:
    technician.begin(computed_project(), "result")
    technician.click("result.save")
    technician.rest()
    technician.click("calibrate.next")
    step = technician.wizard.at("validation")
    panel = technician.wizard.panel
    assert not panel.capture.isEnabled()  # there is no camera
    step.import_press(small_session / "presses" / "cylinder_s5_d100.png")
    technician.until(lambda: "Diameter" in panel.notice.text())
    known = step.form.value
    assert (known.shape, known.size_mm, known.height_mm) == ("cylinder", 5.0, 1.0)
    technician.click("validation.keep")
    assert technician.state("validation") == "pass"


def test_a_waiting_step_names_the_step_it_waits_for(technician: Technician, fresh: Project) -> None:
    technician.begin(fresh, "result")
    tabs = technician.wizard.at("result").tabs
    tabs.setCurrentIndex(1)
    assert "earlier steps" in technician.see("calibrate.maps.none").text()
    assert "Lens" in technician.wizard.model.page.states["result"][1]


def test_a_saved_calibration_is_validated_while_stages_are_recomputed(
    technician: Technician, computed_project: Made, small_session: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    technician.begin(computed_project(), "result")
    technician.click("result.save")
    technician.rest()
    folder, hold = technician.session, threading.Event()
    technician.page.leave_session()
    compute = Project.compute
    with monkeypatch.context() as slow:
        slow.setattr(
            Project, "compute",
            lambda self, *given: (hold.wait(60.0), compute(self, *given))[1],
        )  # fmt: skip
        technician.page.open_path(folder)
        wizard = technician.wizard
        assert wizard.open.key == "validation"
        step = wizard.at("validation")
        assert "present captures" in step.calibration.text()
        wizard.go_to("result")
        assert "You can validate it now" in wizard.at("result").overview.headline.text()
        wizard.go_to("validation")
        step.import_press(small_session / "presses" / "cylinder_s5_d100.png")
        technician.until(lambda: "Diameter" in wizard.panel.notice.text())
        assert wizard.model.jobs.busy
        wizard.model.exclude("balls", "ball_01.png", True)
        assert "have changed since" in step.calibration.text()
        wizard.model.undo.undo()
        assert "present captures" in step.calibration.text()
        wizard.model.jobs.cancel()
        hold.set()
        technician.rest()
