"""Save a finished calibration into the library, and write its report."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QFileDialog

from app.calibrate.controller import CalibrationController
from app.calibrate.result_view import ResultView
from app.shell.context import AppContext
from app.shell.jobs import Job
from gelpolight_core.calibration.pipeline import CalibrationRun
from gelpolight_core.translation import tr


class Saving(QObject):
    """The buttons of the last look.

    Signals
    -------
    saved(str)
        Place of a calibration that was saved.
    """

    saved = Signal(str)

    def __init__(
        self, controller: CalibrationController, view: ResultView, *, context: AppContext
    ) -> None:
        super().__init__(view)
        self._controller, self._view, self._context = controller, view, context
        view.save_wanted.connect(self.save)
        view.report_wanted.connect(self.report)

    def save(self) -> None:
        """Put the calibration together and write it into the library, in use from now on."""
        project, workspace = self._controller.project, self._context.workspace

        def work(_tell: object) -> Path:
            calibration = project.finish().calibration
            name = f"{calibration.sensor.serial}-{datetime.now().astimezone():%Y-%m-%d-%H%M%S}"
            path = workspace.keep_calibration(calibration, name)
            workspace.use(path)
            return path

        def done(path: Path) -> None:
            self._view.show_saved(
                tr("Saved as {path}, and in use now. Validate it next.").format(path=path)
            )
            self._context.requests.calibrations_changed.emit()
            self.saved.emit(str(path))

        self._submit(tr("Saving the calibration"), work, done)

    def _submit(
        self, title: str, work: Callable[[object], Any], done: Callable[[Any], None]
    ) -> None:
        self._view.show_saved(title + "…")

        def failed(sentence: str) -> None:
            self._view.show_saved(sentence, "fail")

        self._controller.jobs.submit(Job(title, work, done, failed, stopped=failed))

    def report(self) -> None:
        """Ask for a place, and write the report there."""
        session = self._controller.project.session
        proposed = self._context.settings.last_folder / f"{session.sensor.serial}-report.html"
        chosen, _ = QFileDialog.getSaveFileName(
            self._view,
            tr("Write the report"),
            str(proposed),
            tr("Web page (*.html);;PDF (*.pdf)"),
        )
        if chosen:
            self.write_report(Path(chosen))

    def write_report(self, path: Path) -> None:
        """Write the report of the session as it stands."""
        project = self._controller.project

        def work(_tell: object) -> CalibrationRun:
            from gelpolight_core.report.build import run_report  # heavy
            from gelpolight_core.report.file import write_report

            run = project.finish()
            write_report(run_report(run, project.session), path)
            return run

        def done(_run: CalibrationRun) -> None:
            self._view.show_saved(tr("Report written to {path}").format(path=path))

        self._submit(tr("Writing the report"), work, done)
