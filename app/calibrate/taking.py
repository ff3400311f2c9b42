"""Taking pictures for a step: by hand, by itself, from files; and leaving them out."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QFileDialog

from app.calibrate.looking import Looking
from app.calibrate.wizard_frame import WizardFrame
from gelpolight_core.translation import tr


class Taking(QObject):
    """Brings pictures into the step that is shown.

    Parameters
    ----------
    frame : WizardFrame
        The widgets.
    looking : Looking
        What is looked at in them.
    """

    def __init__(self, frame: WizardFrame, looking: Looking) -> None:
        super().__init__(frame)
        self._frame, self._looking = frame, looking
        self._panel, self._controller = frame.panel, frame.controller
        frame.panel.capture_wanted.connect(self.capture)
        frame.panel.import_wanted.connect(self._choose_files)
        frame.pictures.strip.excluded.connect(self._exclude)
        looking.good.connect(self._capture_by_itself)
        frame.controller.captured.connect(self._on_captured)

    def capture(self) -> None:
        """Take a picture; from one that is looked at, go back to the live picture first."""
        if self._looking.name:
            self._looking.live()
        elif self._looking.has_pictures:
            self._panel.show_notice("", "pass")
            self._looking.captured()
            self._controller.capture(self._frame.step, radius_mm=self._looking.radius_mm)

    def _capture_by_itself(self) -> None:
        if not self._panel.automatic.isChecked():
            return
        if self._panel.types_radius:  # half a number is none
            text = tr("Press Enter after the radius: then pictures are taken by themselves.")
            self._panel.show_notice(text, "warn")
            return
        self.capture()

    def _on_captured(self, stage: str, name: str) -> None:
        shown = self._frame.step.stage
        if shown is not None and shown.value == stage:
            self._panel.show_notice(tr("Captured {name}.").format(name=name), "pass")
            self._frame.pictures.strip.show_newest()

    def _choose_files(self) -> None:
        if self._frame.step.stage is None:
            return
        settings = self._frame.context.settings
        files, _ = QFileDialog.getOpenFileNames(
            self._frame,
            tr("Import pictures"),
            str(settings.last_folder),
            tr("Pictures (*.png *.tif *.tiff)"),
        )
        if files:
            settings.last_folder = Path(files[0]).parent
            self.import_files([Path(file) for file in files])

    def import_files(self, files: list[Path]) -> None:
        """Take picture files into the step."""
        stage = self._frame.step.stage
        if stage is not None:
            self._panel.show_notice("", "pass")
            self._controller.import_files(stage, files, radius_mm=self._looking.radius_mm)

    def _exclude(self, name: str, excluded: bool) -> None:
        stage = self._frame.step.stage
        if stage is not None:
            self._controller.exclude(stage, name, excluded)
