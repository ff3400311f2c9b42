"""A trial belongs only to the calibration with which it was made."""

import shutil
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from report_pdf import report_data
from technician import Technician

from app.calibrate import validation as validating
from app.calibrate.result import write_report
from app.command_line.main import main
from gelpolight_core.calibration.manifest import read_summary
from gelpolight_core.calibration.project import Project
from gelpolight_core.calibration.remarks import write_validation
from gelpolight_core.finding import doubt
from gelpolight_core.quantity import Quantity
from gelpolight_core.validation import Validation

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


def save(technician: Technician, project: Project, workspace: Path) -> Path:
    """Save the calibration and open the validation; return the saved path."""
    technician.begin(project, "result")
    technician.save()
    technician.click("calibrate.next")
    (path,) = workspace.rglob("*.gplcal")
    return path


def test_a_trial_is_of_its_calibration_and_trusted_and_its_reports_state_it(
    technician, computed_project, small_session, tmp_path, monkeypatch
):
    path = save(technician, computed_project(), tmp_path / "workspace")
    newer = Path(shutil.copy(path, path.with_name("newer.gplcal")))
    wizard = technician.wizard
    step, panel = wizard.at("validation"), wizard.panel
    held = Held(validating.read_calibration)
    monkeypatch.setattr(validating, "read_calibration", held)
    step.import_press(small_session / PRESS)
    technician.until(held.begun.is_set)
    wizard.model.use_calibration(newer)
    held.go.set()
    technician.until(lambda: not wizard.model.short_jobs.busy)
    assert step._reconstructor[1] is None
    assert not step.keep.isEnabled()
    assert not panel.notice.text()

    step.import_press(small_session / PRESS)
    technician.until(step.keep.isEnabled)
    trial = step._trial
    unsure = replace(trial.measurement, findings=(doubt("cut", "cut by the border"),))
    step.show_trial(replace(trial, measurement=unsure))
    assert not step.keep.isEnabled()
    assert "cut by the border" in panel.notice.text()

    step.show_trial(trial)
    step.record()
    write_report(tmp_path / "window.pdf", step)
    technician.rest()
    assert main(["report", str(newer), "-o", str(tmp_path / "command.pdf")]) == 0
    window, command = (report_data(tmp_path / f"{n}.pdf") for n in ("window", "command"))
    assert window["validation"] == command["validation"]
    assert not command["validation"]["sentence"].startswith("Not validated")
    assert command["validation"]["data"]["identity"] == read_summary(newer).identity


def test_only_a_trial_of_this_calibration_and_of_the_present_captures_validates(
    technician, computed_project, tmp_path
):
    path = save(technician, computed_project(), tmp_path / "workspace")
    model, panel = technician.wizard.model, technician.wizard.panel
    passed = Quantity("height", 1.0, truth=1.0, limit_percent=8.0)
    for identity, state in (("another", "empty"), (read_summary(path).identity, "pass")):
        trial = Validation(identity, "2026-03-01T12:00:00+00:00", "Ada", "cylinder", (passed,))
        write_validation(trial, path)
        model.changed.emit()
        assert technician.state("validation") == state
    context = technician.page.context
    context.requests.calibrations_changed.emit()
    assert context.workspace.in_use == path
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
