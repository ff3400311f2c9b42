"""Save a finished calibration into the library, and write its report."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QFileDialog

from app.calibrate.model import WizardModel
from app.calibrate.result.view import ResultView
from app.context.context import AppContext
from app.services.jobs import Job
from gelpolight_core.calibration.pipeline import CalibrationRun
from gelpolight_core.translation import tr


class Saving(QObject):
    """Handles the Save and Report buttons of the result step.

    Parameters
    ----------
    model : WizardModel
        Model of the wizard.
    view : ResultView
        The buttons, and where it is shown what was saved.
    context : AppContext
        Context with the library.
    """

    def __init__(self, model: WizardModel, view: ResultView, *, context: AppContext) -> None:
        super().__init__(view)
        self._model, self._view, self._context = model, view, context
        view.save_wanted.connect(self.save)
        view.report_wanted.connect(self.report)

    def save(self) -> None:
        """Write the calibration into the library, and use it from now on unless it failed."""
        project, workspace = self._model.project, self._context.workspace

        def work(_progress: object) -> tuple[Path, str]:
            calibration = project.finish().calibration
            name = f"{calibration.sensor.serial}-{datetime.now().astimezone():%Y-%m-%d-%H%M%S}"
            path = workspace.keep_calibration(calibration, name)
            if not calibration.fault:
                workspace.use(path)
            return path, calibration.fault

        def done(saved: tuple[Path, str]) -> None:
            path, fault = saved
            text = tr("Saved as {path} and now in use. Validate it next.")
            if fault:
                text = tr("Saved as a draft, {path}, and not in use: {fault}.")
            self._view.show_saved(text.format(path=path, fault=fault), "fail" if fault else "pass")
            self._context.requests.calibrations_changed.emit()
            self._model.saved_as.emit(str(path))

        self._submit(tr("Saving the calibration"), work, done)

    def _submit(
        self, title: str, work: Callable[[object], Any], done: Callable[[Any], None]
    ) -> None:
        self._view.show_saved(title + "…")

        def failed(sentence: str) -> None:
            self._view.show_saved(sentence, "fail")

        self._model.jobs.submit(Job(title, work, done, failed, stopped=failed))

    def report(self) -> None:
        """Ask for a file name and write the report there."""
        session = self._model.project.session
        settings = self._context.settings
        proposed = settings.folder("report") / f"{session.sensor.serial}-report.html"
        chosen, _ = QFileDialog.getSaveFileName(
            self._view,
            tr("Write the report"),
            str(proposed),
            tr("Web page (*.html);;PDF (*.pdf)"),
        )
        if chosen:
            settings.keep_folder("report", Path(chosen).parent)
            self.write_report(Path(chosen))

    def write_report(self, path: Path) -> None:
        """Write the report of the session in its present state."""
        project = self._model.project

        def work(_progress: object) -> CalibrationRun:
            from gelpolight_core.report.build import run_report  # slow to import
            from gelpolight_core.report.file import write_report

            run = project.finish()
            write_report(run_report(run, project.session), path)
            return run

        def done(_run: CalibrationRun) -> None:
            self._view.show_saved(tr("Report saved as {path}").format(path=path))

        self._submit(tr("Writing the report"), work, done)
