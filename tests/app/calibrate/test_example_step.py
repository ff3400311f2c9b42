"""A step of the wizard without images is one class: this one keeps notes on the sensor."""

from pathlib import Path

import pytest
from PySide6.QtWidgets import QPlainTextEdit, QWidget

from app.calibrate import wizard
from app.calibrate.page_state import StepState
from app.calibrate.step import Step
from gelpolight_core.base.atomic_write import write_atomically
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.stage_status import StageState


class NotesStep(Step):
    """Keeps notes on the sensor in notes.txt."""

    key, title = "notes", "Notes"
    task = "Write down what is special."

    def build(self) -> None:
        """Create the text editor."""
        self.editor = QPlainTextEdit()

    @property
    def file(self) -> Path:
        """The file of the notes."""
        return self.model.project.session.folder / "notes.txt"

    @property
    def centre(self) -> QWidget:
        """The text editor."""
        return self.editor

    def state(self) -> StepState:
        """Return that the step is done as soon as there is a file."""
        state = StageState.PASS if self.file.is_file() else StageState.EMPTY
        return state.value, ""

    def enter(self) -> None:
        """Show the notes."""
        super().enter()
        self.editor.setPlainText(self.file.read_text("utf-8") if self.file.is_file() else "")

    def leave(self) -> None:
        """Save changed notes, also when the program ends at this moment."""
        if self.editor.document().isModified():
            text = self.editor.toPlainText().encode("utf-8")
            write_atomically(self.file, lambda file: file.write(text))

    def close(self) -> None:
        """Save changed notes."""
        self.leave()


@pytest.mark.function("Add a step to the wizard")
def test_the_example_step_keeps_the_notes(technician, fresh, monkeypatch):
    monkeypatch.setattr(wizard, "FIRST", (*wizard.FIRST, NotesStep))
    technician.begin(fresh, "notes")
    assert technician.state("notes") == "empty"
    technician.wizard.at("notes").editor.insertPlainText("Zweiter Würfel, neue Membran")
    technician.wizard.go_to("lens")
    assert (technician.session / "notes.txt").read_text("utf-8") == "Zweiter Würfel, neue Membran"
    assert technician.state("notes") == "pass"
    notes = technician.session / "notes.txt"
    technician.begin(CalibrationProject(technician.session), "lens")
    technician.page.can_close()
    assert notes.read_text("utf-8").startswith("Zweiter"), "not opened: nothing saved"
    technician.begin(CalibrationProject(notes.parent), "notes")
    assert technician.wizard.at("notes").editor.toPlainText().startswith("Zweiter")
    technician.rest()
