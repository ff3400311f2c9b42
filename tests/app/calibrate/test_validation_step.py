"""Listed presses validate a calibration; measurements belong only to the one that they tested."""

import json
import shutil
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from report_pdf import report_data
from technician import Technician, read_rgb

from app.calibrate import validation_step as validating
from app.calibrate.result_step import write_session_report
from app.cli.main import main
from app.program.calibration_status import show_in_use
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.finding import doubtful_finding
from gelpolight_core.calibration.annotations import write_validation
from gelpolight_core.calibration.manifest import read_summary
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.session.reference_object import ReferenceObject
from gelpolight_core.session.validation import Validation

PRESS = "presses/cylinder_s5_d100.png"


class Held:
    """A function that waits from its first call until it is released."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self.begun, self.go = threading.Event(), threading.Event()

    def __call__(self, *given: Any, **named: Any) -> Any:
        """Wait, then call the function."""
        self.begun.set()
        self.go.wait(60.0)
        return self._function(*given, **named)


def save(technician: Technician, project: CalibrationProject, workspace: Path) -> Path:
    """Save the calibration and open the validation without presses; return the saved path."""
    shutil.rmtree(project.session.folder / "presses")
    technician.begin(project, "result")
    technician.save()
    technician.click("calibrate.next")
    (path,) = workspace.rglob("*.gplcal")
    return path


@pytest.mark.function("`gelpolight report`: states the validation made in the window")
def test_a_trial_is_of_its_calibration_and_trusted_and_its_reports_state_it(
    technician, computed_project, small_session, tmp_path, monkeypatch
):
    path = save(technician, computed_project(), tmp_path / "workspace")
    newer = Path(shutil.copy(path, path.with_name("newer.gplcal")))
    wizard = technician.wizard
    step = wizard.at("validation")
    held = Held(validating.read_calibration)
    monkeypatch.setattr(validating, "read_calibration", held)
    step.import_press(small_session / PRESS)
    technician.until(held.begun.is_set)
    assert not step.keep.isEnabled()
    wizard.model.use_calibration(newer)
    held.go.set()
    technician.until(step.keep.isEnabled)
    assert step._reconstructor[0] == newer, "the press is measured with the one that is saved now"

    press, heightmap = step._newest
    unsure = replace(press.measurement, findings=(doubtful_finding("cut", "cut by the border"),))
    step.show_measured(replace(press, outcome=unsure), heightmap)
    assert not step.keep.isEnabled()
    assert "cut by the border" in step.result.text()

    step.show_measured(press, heightmap)
    step.record()
    write_session_report(tmp_path / "window.pdf", step)
    technician.rest()
    assert main(["report", str(newer), "-o", str(tmp_path / "command.pdf")]) == 0
    window, command = (report_data(tmp_path / f"{n}.pdf") for n in ("window", "command"))
    assert window["validation"] == command["validation"]
    assert not command["validation"]["sentence"].startswith("Not validated")
    assert command["validation"]["data"]["identity"] == read_summary(newer).identity


@pytest.mark.function(
    "Validate with a list of objects, guided from press to press, and continue it later",
    "Retake a press of a validation, or leave it out",
)
def test_listed_presses_are_asked_for_one_by_one_continued_later_and_evaluated(
    technician, camera, computed_project, small_session, tmp_path
):
    path = save(technician, computed_project(), tmp_path / "workspace")
    step = technician.wizard.at("validation")
    saved = step.known.findText("Cylinder 5 mm, 1 mm high")
    step.known.setCurrentIndex(saved)
    step.known.activated.emit(saved)
    step.count_asked.setValue(2)
    technician.click("validation.add")
    step.show_known(ReferenceObject("cuboid", 4.0, size_expanded_mm=0.01, height_mm=1.0))
    step.count_asked.setValue(1)
    technician.click("validation.add")
    assert "1 of 3: cylinder, 5 mm" in step.next_press.text()
    camera.show(read_rgb(small_session / PRESS))
    technician.until(technician.wizard.panel.capture.isEnabled)
    technician.click("calibrate.capture")
    technician.until(lambda: step._outcomes)
    assert "2 of 3: cylinder" in step.next_press.text() and not step.keep.isEnabled()
    assert technician.state("validation") == "begun"

    folder = technician.session
    technician.page.leave_session()
    technician.page.open_path(folder)
    step = technician.wizard.at("validation")
    technician.wizard.go_to("validation")
    technician.until(lambda: step._outcomes)
    assert "2 of 3: cylinder" in step.next_press.text()
    step.import_press(small_session / PRESS)
    technician.until(lambda: len(step._outcomes) == 2)
    assert "3 of 3: cuboid" in step.next_press.text()
    step.table.rows.choose(step._presses[2].file)
    technician.click("validation.leave_out")
    assert step.keep.isEnabled()
    assert technician.state("validation") == "unrecorded" and step.number().value > 0.0
    assert step.verdict.text().startswith("Conforms by 2 presses of 1 object")
    technician.click("validation.keep")
    assert technician.state("validation") == "pass"
    assert not step.keep.isEnabled(), "this one is recorded"
    end = technician.see("calibrate.remedy0")
    technician.until(lambda: not end.visibleRegion().isEmpty())
    validation = read_summary(path).validation
    assert [c.name for c in validation.comparisons] == ["diameter", "height"] * 2

    out = tmp_path / "evaluation"
    assert main(["evaluate", str(path), str(folder), "-o", str(out)]) == 0
    presses = json.loads((out / "evaluation.json").read_text())["presses"]
    heights = [c.value for c in validation.comparisons if c.name == "height"]
    assert [press["height_mm"] for press in presses] == heights

    first = step._presses[0].file
    step.table.rows.choose(first)
    technician.click("validation.retake")
    assert "1 of 2: cylinder" in step.next_press.text()
    assert (folder / "presses" / first).is_file(), "the image stays until it is replaced"
    technician.wizard.model.jobs.cancel()
    technician.rest()


def test_a_session_opened_to_validate_a_calibration_shows_that_one_in_its_step(
    technician, computed_project, tmp_path
):
    path = save(technician, computed_project(), tmp_path / "workspace")
    older = Path(shutil.copy(path, path.with_name("older.gplcal")))
    identity = read_summary(path).identity
    failed = Quantity("height", 2.0, truth=1.0, limit_percent=8.0)
    for one in (path, older):
        write_validation(Validation(identity, "2026-03-01T12:00:00+00:00", "", "x", (failed,)), one)
    workspace, folder = technician.page.context.workspace, technician.session
    for to_validate, step in ((older, "validation"), (None, "result"), (path, "validation")):
        workspace.to_validate = to_validate
        technician.page.open_path(folder)
        technician.until(lambda key=step: technician.wizard.open.key == key)
        assert to_validate in (None, technician.wizard.model.saved_path)
        assert workspace.to_validate is None
        technician.wizard.model.jobs.cancel()
        technician.rest()


@pytest.mark.parametrize("inside", [True, False])
def test_an_image_of_the_calibration_is_no_press_of_its_validation(
    technician, computed_project, tmp_path, inside
):
    save(technician, computed_project(), tmp_path / "workspace")
    step, ball = technician.wizard.at("validation"), technician.session / "balls" / "ball_01.png"
    step.show_known(ReferenceObject("ball", 5.0))
    if inside:  # another program copied it
        step.add()
        shutil.copy(ball, technician.session / "presses" / step._presses[0].file)
        step._follow()
        technician.until(lambda: step._outcomes)
        assert "used for the calibration" in step.result.text()
    else:
        renamed = Path(shutil.copy(ball, tmp_path / "cylinder.png"))
        step.import_press(renamed)
        assert "used for the calibration" in technician.wizard.model.page.notice[0]
        assert not step._presses
    assert not step.keep.isEnabled()
    technician.wizard.model.jobs.cancel()
    technician.rest()


def test_only_a_trial_of_this_calibration_and_of_the_present_captures_validates(
    technician, computed_project, tmp_path
):
    path = save(technician, computed_project(), tmp_path / "workspace")
    model, panel = technician.wizard.model, technician.wizard.panel
    passed = Quantity("height", 1.0, truth=1.0, limit_percent=8.0)
    unsure, identity = replace(passed, sd=0.05), read_summary(path).identity
    for named, height, state in (
        ("another", passed, "empty"), (identity, unsure, "warn"), (identity, passed, "pass"),
    ):  # fmt: skip
        trial = Validation(named, "2026-03-01T12:00:00+00:00", "Ada", "cylinder", (height,))
        write_validation(trial, path)
        model.changed.emit()
        assert technician.state("validation") == state
        if state == "warn":
            assert "tolerance of 10 % can be decided" in model.page.sentence
    context = technician.page.context
    context.requests.calibrations_changed.emit()
    assert context.workspace.in_use == path
    technician.wizard.go_to("validation")
    sentence = technician.see("calibrate.sentence").text()
    assert sentence == "Validated by 1 press of 1 object. Largest error 0 %. In use."
    show_in_use(context)
    assert "1 press of 1 object" in context.status.value.calibration_advice
    assert context.status.value.task == "", "the state bar shows the calibration in use"
    assert [button.text() for button in panel.buttons] == ["&Inspect", "M&easure", "&Report…"]
    context.workspace.use(None)
    context.requests.calibrations_changed.emit()
    assert panel.buttons[0].text() == "&Use it now"
    technician.click("calibrate.remedy0")
    assert context.workspace.in_use == path
    assert panel.buttons[0].text() == "&Inspect"

    model.exclude("balls", "ball_01.png", True)
    assert technician.state("validation") == "stale"
    model.undo.undo()
    assert technician.state("validation") == "pass"
    model.jobs.cancel()
    technician.rest()
