"""The example of a wizard step in CONTRIBUTING.md works in the wizard."""

from pathlib import Path
from typing import Any

from app.calibrate import wizard
from gelpolight_core.calibration.project import Project

CONTRIBUTING = Path(__file__).parents[3] / "CONTRIBUTING.md"


def example(name: str) -> Any:
    """Return a class that an example of CONTRIBUTING.md defines."""
    for text in CONTRIBUTING.read_text("utf-8").split("```python\n")[1:]:
        code = text.partition("```")[0]
        if f"class {name}(" in code:
            defined: dict[str, Any] = {"__name__": "example"}
            exec(compile(code, str(CONTRIBUTING), "exec"), defined)
            return defined[name]
    raise AssertionError(f"CONTRIBUTING.md defines no {name}")


def test_the_example_step_keeps_the_notes(technician, fresh, monkeypatch):
    monkeypatch.setattr(wizard, "FIRST", (*wizard.FIRST, example("NotesStep")))
    technician.begin(fresh, "notes")
    assert technician.state("notes") == "empty"
    technician.wizard.at("notes").editor.insertPlainText("Zweiter Würfel, neue Membran")
    technician.wizard.go_to("lens")
    assert (technician.session / "notes.txt").read_text("utf-8") == "Zweiter Würfel, neue Membran"
    assert technician.state("notes") == "pass"
    notes = technician.session / "notes.txt"
    technician.begin(Project(technician.session), "lens")
    technician.page.may_close()
    assert notes.read_text("utf-8").startswith("Zweiter"), "not opened: nothing saved"
    technician.begin(Project(notes.parent), "notes")
    assert technician.wizard.at("notes").editor.toPlainText().startswith("Zweiter")
    technician.rest()
