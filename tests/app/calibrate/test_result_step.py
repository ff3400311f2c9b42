"""The Result page belongs to the present results."""

import pytest


@pytest.mark.function("See the pictures of the present result only, also of a failed one")
def test_pictures_and_terms_are_those_of_the_headline(technician, computed_project):
    project = computed_project()
    technician.begin(project, "result")
    wizard, step = technician.wizard, technician.wizard.at("result")
    technician.until(lambda: step.overview.plots)
    assert "%" in step.terms.text()
    drawn = step.results.get(project.recipe.stages[-1])

    wizard.model.stopped = True
    project.exclude("balls", "ball_01.png", True)
    wizard.refresh()
    assert step.overview.plots == ()
    assert "%" not in step.terms.text()
    step._show_result(drawn, (("late",), (), ""))
    assert step.overview.plots == (), "what is drawn too late is not shown"

    project.exclude("balls", "ball_01.png", False)
    project._tolerance_percent = 1e-3
    wizard.refresh()
    assert "fail" in (state for state, _ in wizard.model.page.states.values())
    technician.until(lambda: step.overview.plots)
    bars = step.overview.plots[0].picture.marks
    assert "warn" in (mark.role for mark in bars if hasattr(mark, "role"))


@pytest.mark.function("Save a calibration once")
def test_a_calibration_is_saved_again_only_after_a_change_or_if_its_file_is_gone(
    technician, computed_project
):
    technician.begin(computed_project(), "result")
    wizard, step = technician.wizard, technician.wizard.at("result")
    step.save.click()
    assert not step.save.isEnabled(), "while it is being saved"
    technician.rest()
    assert not step.save.isEnabled()
    assert step.save.toolTip()
    assert step.report.isEnabled()
    wizard.model.saved_path.unlink()
    wizard.refresh()
    assert step.save.isEnabled()
    assert not step.save.toolTip()
