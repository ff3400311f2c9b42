"""What a technician relies on in the wizard."""

import shutil
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtWidgets import QPushButton
from technician import read_rgb

from app.calibrate import image_step
from app.program.jobs import BackgroundJob
from gelpolight_core.base.finding import QualityTable, Verdict, judge
from gelpolight_core.calibration.calibration_file import read_calibration
from gelpolight_core.calibration.manifest import read_summary
from gelpolight_core.calibration.open_ball_stages import BALLS
from gelpolight_core.calibration.open_sensor_recipe import LIGHTS, TOP_POSE
from gelpolight_core.calibration.project import CalibrationProject


@pytest.fixture
def hold():
    """Return the event that long work waits for."""
    hold = threading.Event()
    yield hold
    hold.set()


@pytest.mark.function("Press balls of any size, each with its radius")
def test_a_press_is_captured_with_the_diameter_that_is_typed(
    technician, camera, computed_project, small_session, qtbot
):
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
    (name,) = reported
    assert technician.kept.ball_radii_mm[name] == 4.0
    assert technician.kept.image(technician.session / "balls" / name).size == (320, 240)
    technician.until(lambda: Path(name).stem in wizard.area.verdict.title.text())
    technician.rest()


@pytest.mark.function(
    "Exclude a capture, and undo it",
    "Correct a detected contact by hand",
    "Correct the radius of a captured press",
    "Find the capture that fits worst, and repeat it",
)
def test_what_was_found_on_a_press_is_corrected_and_undone(technician, computed_project, qtbot):
    project = computed_project()
    technician.begin(project, "balls")
    wizard = technician.wizard
    undo, name = wizard.model.undo, project.session.found("balls")[0].name
    wizard.show_capture(name)
    technician.until_live("Ball found")
    wizard.area.view.moved.emit("ball", 160.0, 120.0, 14.0)
    technician.until_live("by hand")
    placed = technician.kept.decisions.balls[name]
    assert (placed.u_px, placed.v_px, placed.radius_px) == (160.0, 120.0, 14.0)
    undo.undo()
    technician.until_live("Ball found")

    before = project.session.ball_radius_mm(name)
    wizard.at("balls").radius.setValue(2.0 * before + 1.0)
    assert technician.kept.ball_radius_mm(name) == before + 0.5
    undo.undo()
    assert technician.kept.ball_radius_mm(name) == wizard.at("balls").radius_mm == before

    strip = wizard.area.strip
    strip.choose(name)
    qtbot.keyClick(strip, Qt.Key.Key_Delete)
    assert f"balls/{name}" in technician.kept.decisions.excluded
    assert "excluded" in strip.item(0).text()
    qtbot.keyClick(wizard, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    technician.rest()
    assert technician.kept.decisions.excluded == frozenset()
    assert project.stale() == ()

    # The worst press is excluded to be repeated.
    def shown_worst() -> str:
        return wizard.model.page.worst_first[0].path.name

    misfits = {press.name: press.shading_misfit for press in project.results[BALLS].presses}
    worst = Path(max(misfits, key=lambda name: misfits[name])).name
    assert len(wizard.panel.residuals.table.figures) >= len(misfits)
    wizard.panel.details.click()
    technician.click("calibrate.residuals.repeat")
    assert technician.kept.decisions.excluded == {f"balls/{worst}"}
    technician.rest()
    assert shown_worst() != worst
    undo.undo()
    technician.rest()
    assert technician.kept.decisions.excluded == frozenset()
    assert shown_worst() == worst


@pytest.mark.function(
    "Let the program capture by itself when the image is good and still",
    "Go on capturing while a stage is computed",
)
def test_views_are_captured_by_hand_and_by_themselves_while_a_stage_is_computed(
    technician, camera, fresh, small_session, monkeypatch, hold
):
    monkeypatch.setattr(image_step, "PAUSE_S", 0.0)
    technician.begin(fresh, "result")
    wizard = technician.wizard
    wizard.at("result").tabs.setCurrentIndex(1)
    assert "earlier steps" in technician.see("calibrate.maps.none").text()
    assert "Lens" in wizard.model.page.states["result"][1], "the step it waits for"

    wizard.go_to("lens")
    done = list[object]()
    wizard.model.jobs.submit(BackgroundJob("Long work", lambda _progress: hold.wait(), done.append))
    first, second = map(read_rgb, sorted((small_session / "checkerboard").glob("*.png"))[:2])

    def captured(count: int) -> bool:
        return len(fresh.session.captured("checkerboard")) == count

    camera.show(first)
    technician.capture()
    assert captured(1)
    # By themselves: only a good, still image, and never the same view twice.
    camera.show(np.full_like(first, 60))
    seen = list[Any]()
    wizard.model.live.processed.connect(lambda item: seen.append(item.result))
    wizard.panel.automatic.setChecked(True)
    technician.until(lambda: seen and seen[-1].still and not seen[-1].detection.good)
    assert captured(1) and not wizard.model.live.capturing
    camera.show(second)
    technician.until(lambda: captured(2))
    seen.clear()
    technician.until(lambda: sum(one.still for one in seen) > 2)
    assert captured(2) and not wizard.model.live.capturing
    assert not done
    hold.set()
    technician.rest()
    assert technician.state("lens") == "begun", "too few are not a failure"
    assert wizard.panel.below.text() == "2 of 12 captured"


@pytest.mark.function("See which stages are outdated, and compute them again")
def test_capturing_again_makes_later_stages_stale_and_offers_recompute(
    technician, camera, computed_project, small_session
):
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
    assert technician.state("balls") == "begun", "five of ten presses"


@pytest.mark.function("Undo and redo captures", "Correct a detected spot by hand")
def test_corrections_and_captures_of_the_lights_are_undone_in_order(
    technician, camera, computed_project, small_session
):
    """The earlier view is in use again, and no image file is ever deleted."""
    project = computed_project()
    technician.begin(project, "lights")
    wizard, model = technician.wizard, technician.wizard.model
    (former,) = (path.name for path in project.session.found("mirror"))
    wizard.show_capture(former)
    technician.until_live("found")
    u, v = project.results[LIGHTS].leds.spots.spots[1].centre_px
    spot = (u + 30.0, v + 20.0)
    wizard.area.view.moved.emit("mirror.1", *spot, 0.0)
    technician.until_live("spot is dark")
    technician.until(lambda: technician.state("lights") == "fail")
    model.exclude("balls", "ball_02.png", True)
    wizard.open.live()
    camera.show(read_rgb(small_session / "mirror" / "mirror.png"))
    name = technician.capture()
    technician.rest()

    def kept() -> tuple[list[str], dict[int, tuple[float, float]], set[str]]:
        session = technician.kept
        out = {one for one in session.decisions.excluded if not one.startswith("mirror/")}
        return [path.name for path in session.found("mirror")], session.decisions.spots_px, out

    ball = {"balls/ball_02.png"}
    history = [
        ([former], {}, set()), ([former], {1: spot}, set()), ([former], {1: spot}, ball),
        ([name], {}, ball),
    ]  # fmt: skip
    assert kept() == history[-1]
    for state in reversed(history[:-1]):
        model.undo.undo()
        assert kept() == state
    for state in history[1:]:
        model.undo.redo()
        assert kept() == state
    assert (technician.session / "mirror" / name).is_file()
    technician.rest()


@pytest.mark.function(
    "Calibrate a sensor in the wizard and get the same calibration as by command",
    "Validate with a pressed object of known size",
)
def test_the_saved_calibration_equals_that_of_the_command_line_and_a_trial_validates_it(
    technician, camera, computed_project, small_calibration, small_session, tmp_path
):
    project = computed_project()
    shutil.rmtree(project.session.folder / "presses")
    technician.begin(project, "result")
    wizard, step = technician.wizard, technician.wizard.at("result")
    step.overview.more.click()
    assert step.save.property("primary") and not wizard.panel.next.property("primary")
    technician.save()
    assert wizard.model.saved in technician.see("result.saved").text()
    assert step.overview.every.isVisible(), "the figures stay open"
    assert not step.save.property("primary") and wizard.panel.next.property("primary")
    (path,) = (tmp_path / "workspace" / "sensors").rglob("*.gplcal")
    made, theirs = read_calibration(path), small_calibration
    assert made.identity == theirs.identity
    for ours, others in (
        (made.data.radiance, theirs.data.radiance),
        (made.data.factors, theirs.data.factors),
        (made.data.full.led_positions_mm, theirs.data.full.led_positions_mm),
        (made.data.full.background, theirs.data.full.background),
    ):
        np.testing.assert_array_equal(ours, others)

    technician.click("calibrate.next")
    camera.show(read_rgb(small_session / "presses" / "cylinder_s5_d100.png"))
    technician.until(wizard.panel.capture.isEnabled)
    technician.click("calibrate.capture")
    technician.until(lambda: "Diameter" in wizard.at("validation").result.text())
    technician.click("validation.keep")
    assert technician.state("validation") == "pass"
    folder = technician.session
    technician.page.leave_session()
    technician.page.open_path(folder)
    wizard = technician.wizard
    assert technician.state("validation") == "pass"
    wizard.model.exclude("balls", "ball_01.png", True)
    wizard.model.jobs.cancel()
    technician.rest()
    assert not wizard.at("result").saved.text()


def test_a_failed_calibration_is_saved_as_a_draft_and_the_one_in_use_stays(
    technician, computed_project, context
):
    technician.begin(computed_project(), "result")
    technician.save()
    used = context.workspace.in_use
    project, step = technician.wizard.project, technician.wizard.at("result")
    results = project._results
    failed = QualityTable((judge("k", "Half a pixel", 0.5, "px", fail=0.3),))
    top = results[TOP_POSE]
    failed_top = replace(top, pose=replace(top.pose, quality=failed))
    project._results = results.having(TOP_POSE, failed_top)
    technician.wizard.model.saved_path = None  # the failed result is not saved
    technician.wizard.refresh()
    assert step.overview.headline.property("meaning") == "fail"
    assert technician.state("result") == "fail"
    assert step.save.text() == "&Save as a draft"
    technician.save()
    (draft,) = context.workspace.sensors_folder.rglob("*-draft.gplcal")
    assert context.workspace.in_use == used
    assert read_summary(draft).verdict is Verdict.FAIL
    assert draft.stem in technician.wizard.panel.notice.text()
    assert not step.save.property("primary")


def test_curves_are_edited_and_undone_also_after_earlier_work_was_stopped(
    technician, computed_project, qtbot, hold
):
    technician.begin(computed_project(), "balls")
    wizard = technician.wizard
    wizard.model.jobs.submit(BackgroundJob("Long work", lambda _progress: hold.wait()))
    wizard.go_to("result")
    step = wizard.at("result")
    step.tabs.setCurrentIndex(2)
    curves = step.curves
    assert "Collecting" in curves._message.text()
    wizard.panel.cancel.clicked.emit()
    hold.set()
    technician.until(lambda: curves.editor is not None)
    # Shown later than made, and only then at work.
    technician.until(curves.editor.preview.isVisible)
    technician.rest()
    editor, fitted = curves.editor, curves.editor.curves
    cosine, value = editor.curve.points[2]
    editor._on_moved(2, cosine, 0.9 * value, True)
    assert editor.curves != fitted
    assert set(technician.kept.decisions.curves) == {0}
    technician.rest()
    qtbot.keyClick(wizard, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert technician.kept.decisions.curves == {}
    technician.rest()
    technician.until(lambda: curves.editor is not None)
    assert curves.editor.curves == fitted
    technician.until(curves.editor.preview.isVisible)
    technician.rest()


def test_a_file_that_another_program_changed_is_not_written_over(technician, computed_project):
    technician.begin(computed_project(), "balls")
    wizard = technician.wizard
    path = technician.session / "decisions.toml"
    path.write_text(
        'format = "gelpolight-decisions"\nversion = 1\nexcluded = ["balls/ball_01.png"]'
    )
    (stage,) = wizard.open.stages
    wizard.model.exclude(stage, "ball_02.png", True)
    technician.until(lambda: "Another program" in technician.see("calibrate.notice").text())
    assert technician.kept.decisions.excluded == {"balls/ball_01.png"}
    technician.page.leave_session()
    technician.begin(CalibrationProject(path.parent), "balls")
    technician.wizard.model.exclude(stage, "ball_02.png", True)
    kept = {"balls/ball_01.png", "balls/ball_02.png"}
    technician.until(lambda: technician.kept.decisions.excluded == kept)
    technician.rest()


@pytest.mark.function("Validate with an image file and its truth.csv")
def test_a_saved_calibration_is_validated_with_an_image_file_while_stages_are_recomputed(
    technician, computed_project, small_session, monkeypatch, hold
):
    project = computed_project()
    shutil.rmtree(project.session.folder / "presses")
    technician.begin(project, "result")
    technician.save()
    folder = technician.session
    technician.page.leave_session()
    compute = CalibrationProject.compute
    with monkeypatch.context() as slow:
        slow.setattr(
            CalibrationProject, "compute",
            lambda self, *given: (hold.wait(), compute(self, *given))[1],
        )  # fmt: skip
        technician.page.open_path(folder)
        wizard = technician.wizard
        assert wizard.open.key == "result"
        assert "You can validate it now" in wizard.at("result").overview.headline.text()
        wizard.go_to("validation")
        step = wizard.at("validation")
        assert step.calibration.isHidden(), "it is of the present captures"
        assert not wizard.panel.capture.isEnabled()  # there is no camera
        step.import_press(small_session / "presses" / "cylinder_s5_d100.png")
        technician.until(lambda: "Diameter" in step.result.text())
        known = step.form.value
        assert (known.shape, known.size_mm, known.height_mm) == ("cylinder", 5.0, 1.0)
        technician.click("validation.keep")
        assert technician.state("validation") == "pass"
        assert wizard.model.jobs.busy
        wizard.model.exclude("balls", "ball_01.png", True)
        assert "have changed since" in step.calibration.text()
        wizard.model.undo.undo()
        assert step.calibration.isHidden(), "it is of the present captures"
        wizard.model.jobs.cancel()
        hold.set()
        technician.rest()


@pytest.mark.parametrize("width", [1024, 1600])
def test_buttons_over_the_image_never_cover_its_tools(technician, computed_project, width):
    technician.page.resize(width, 640)
    technician.begin(computed_project(), "lens")
    area = technician.wizard.area
    technician.wizard.show_capture(technician.wizard.model.page.captures[0].path.name)
    tools = QRect(area.view.bar.mapTo(area, QPoint()), area.view.bar.size())
    assert area.back_to_live.isVisible()
    assert not area.back_to_live.geometry().intersects(tools)
    assert area.stack.geometry().contains(area.back_to_live.geometry())
    technician.rest()


def test_an_access_key_captures_at_once(technician, camera, fresh, monkeypatch):
    technician.begin(fresh, "lens")
    captured = []
    monkeypatch.setattr(technician.wizard.open, "capture", lambda: captured.append(True))
    technician.wizard.panel.capture.setEnabled(True)
    technician.wizard.panel.capture.animateClick()  # as Qt does for an access key
    assert captured, "not 0.1 s later, when the object may be another one"
    technician.rest()


def test_running_work_takes_its_space_from_the_part_that_scrolls(technician, computed_project):
    technician.begin(computed_project(), "validation")
    panel, model = technician.wizard.panel, technician.wizard.model
    technician.until(lambda: not panel.progress.isVisible())
    buttons = panel.capture, panel.lay, technician.wizard.at("validation").keep
    places = [button.mapTo(panel, QPoint()).y() for button in buttons]
    height = panel._scroll.height()
    model.update_page(work=("Computing", 0.5), live=("Hold it still.", "pass"))
    technician.until(lambda: panel._scroll.height() < height)
    assert [button.mapTo(panel, QPoint()).y() for button in buttons] == places
    technician.rest()


@pytest.mark.function("Save a calibration, see what is in use, and go back to the previous one")
def test_saving_says_what_is_in_use_and_offers_the_previous_calibration(
    technician, context, computed_project
):
    context.toasts.attach(technician.page, list)
    technician.begin(computed_project(), "result")
    model = technician.wizard.model
    technician.save()
    first = context.workspace.in_use
    assert first == model.saved_path and "in use" in technician.see("result.saved").text()
    assert not context.toasts.shown(), "there is no previous one"
    saved = Path(shutil.copy(first, first.with_name("new.gplcal")))
    model.keep(saved)
    assert context.workspace.in_use == saved and model.saved_line.endswith(", and in use.")
    (button,) = context.toasts.shown()[-1].findChildren(QPushButton)
    button.click()
    assert context.workspace.in_use == first and model.saved_line.endswith("not in use.")
    technician.rest()
