"""The wizard captures by itself, says when a step is complete, and why it does not go on."""

import numpy as np
import pytest
from technician import read_rgb

from app.program.settings import AppSettings
from gelpolight_core.calibration.project import CalibrationProject


@pytest.fixture
def automatic(context, technician):
    """Switch automatic captures on."""
    context.settings.prefer(captures_automatically=True)


@pytest.mark.function("See that a step is complete, and open the next one")
def test_a_completed_step_stays_open_says_so_and_offers_the_next_one(
    automatic, technician, camera, computed_project, small_session
):
    project = computed_project()
    former = project.session.found("background")[0]
    project.exclude("background", former.name)
    image = read_rgb(small_session / "background" / "background.png")
    camera.show(np.full_like(image, 3))
    technician.begin(project, "background")
    wizard, panel = technician.wizard, technician.wizard.panel
    technician.until(lambda: panel.live.text())
    assert not wizard.model.page.finished
    assert not panel.next.property("primary")
    assert wizard.model.page.live[1] == "muted", "nothing is captured yet: that is no mistake"
    camera.show(image)
    technician.until(lambda: wizard.model.page.finished)
    technician.rest()
    assert len(project.session.found("background")) == 1
    assert wizard.open.key == "background", "a capture that comes now belongs to it"
    technician.until(lambda: "complete" in panel.live.text())
    assert panel.next.property("primary")
    camera.show(np.full_like(image, 3))
    seen = []
    wizard.model.live.processed.connect(lambda item: seen.append(item.result))
    technician.until(lambda: seen and seen[-1] is not None and not seen[-1].detection.ready)
    technician.until(lambda: "complete" in panel.live.text())
    assert wizard.model.page.live[1] == "pass", "what is complete warns of nothing"
    assert panel.next.isVisible() and wizard.at("balls").title in panel.next.text()
    technician.click("calibrate.next")
    assert wizard.open.key == "balls", "they must be compared with the new background"
    technician.rest()


@pytest.mark.function("Stop a computation, and start it again")
def test_after_stop_nothing_starts_by_itself_and_recompute_is_offered(technician, computed_project):
    technician.page._show_wizard(CalibrationProject(computed_project().session.folder))
    wizard = technician.wizard
    assert wizard.open.key == "result" and wizard.model.jobs.busy
    wizard.panel.cancel.click()
    technician.rest()
    assert technician.see("calibrate.notice").text()
    assert technician.see("calibrate.remedy0").text() == "Recompute"
    wizard.go_to("balls")
    assert not wizard.model.jobs.busy
    technician.click("calibrate.remedy0")
    assert wizard.model.jobs.busy
    wizard.panel.cancel.click()
    technician.rest()


def test_a_session_opens_at_its_result_until_that_is_computed(technician, computed_project):
    project = computed_project()
    technician.begin(project, "result")
    technician.save()
    assert technician.wizard.first_open_step() == "validation"
    technician.page._show_wizard(CalibrationProject(project.session.folder))
    assert technician.wizard.model.saved and technician.wizard.open.key == "result"
    technician.wizard.panel.cancel.click()
    technician.rest()


def test_next_is_refused_with_the_reason_while_a_step_is_incomplete(
    technician, context, computed_project, tmp_path
):
    project = computed_project()
    for path in project.session.found("mirror"):
        project.exclude("lights", path.name)
    technician.begin(project, "lights")
    technician.click("calibrate.next")
    assert technician.wizard.open.key == "lights"
    assert technician.wizard.panel.notice.text() == technician.wizard.open.obstacle() != ""
    project.exclude("lights", project.session.captured("mirror")[0].name, False)
    technician.wizard.model.changed.emit()
    technician.click("calibrate.next")
    assert technician.wizard.open.key == "radiance"
    # Automatic captures are on for a new user, and the change is remembered.
    assert AppSettings(tmp_path / "new.ini").preferences.captures_automatically
    assert not technician.wizard.panel.automatic.isChecked()
    technician.wizard.panel.automatic.trigger()
    assert context.settings.preferences.captures_automatically
    technician.rest()


def test_a_good_image_that_was_there_before_asks_for_a_movement(
    automatic, technician, camera, computed_project, small_session
):
    project = computed_project()
    camera.show(read_rgb(small_session / "balls" / "ball_01.png"))
    technician.begin(project, "balls")
    technician.wizard.at("balls").radius.setValue(
        2.0 * project.session.ball_radius_mm("ball_01.png")
    )
    panel, count = technician.wizard.panel, len(project.session.captured("balls"))
    technician.until(lambda: panel.live.property("meaning") == "pass")
    technician.until(lambda: "Move it" in panel.live.text())
    seen = []
    technician.wizard.model.live.processed.connect(lambda item: seen.append(item.result))
    technician.until(lambda: seen and seen[-1].still)
    assert not technician.wizard.model.live.capturing
    assert len(project.session.captured("balls")) == count
    technician.wizard.at("balls").wanted = count  # a step that is complete asks for nothing
    technician.wizard.refresh()
    assert technician.wizard.model.page.state in ("pass", "warn")
    technician.until(lambda: "complete" in panel.live.text())
    technician.rest()
