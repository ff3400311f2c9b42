"""The Calibrate page: where to begin, or the wizard of the session that is open."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from pathlib import Path

from PySide6.QtWidgets import QFileDialog, QStackedWidget, QVBoxLayout, QWidget

from app.calibrate.session_camera import SetupCamera
from app.calibrate.setup_form import SetupForm, new_session
from app.calibrate.start_view import StartView
from app.calibrate.wizard import Wizard
from app.shell.context import AppContext
from app.widgets.naming import named
from app.widgets.source_button import SourceButton
from app.workspace.workspace import folder_name
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.errors import InputError
from gelpolight_core.session.description import create_session
from gelpolight_core.session.session import Session
from gelpolight_core.translation import tr


class CalibratePage(QWidget):
    """Shows the start view, the form of a new session, or the wizard.

    Parameters
    ----------
    context : AppContext
        The program's.
    """

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()
        named(self, "calibrate", tr("Calibrate"))
        self.context = context
        self.wizard: Wizard | None = None
        self._shown = False
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        self._stack = QStackedWidget()
        column.addWidget(self._stack)
        self.start = StartView()
        self.form = SetupForm()
        none = tr("No camera: import pictures")
        self.form.offer_cameras(SourceButton(context=context, page="setup", none=none))
        self._stack.addWidget(self.start)
        self._stack.addWidget(self.form)
        self.start.new_wanted.connect(self.begin)
        self.start.open_wanted.connect(self.choose_folder)
        self.start.demo_wanted.connect(self.begin_demo)
        self.start.recent_wanted.connect(lambda folder: self.open_path(Path(folder)))
        self.form.accepted.connect(self._create)
        context.source.changed.connect(self._on_source)
        self.setup_camera = SetupCamera(self.form, context=context)
        self.start.show_recent(context.settings.recent_sessions)

    # What the window asks of a page

    def enter(self) -> None:
        """Show what is new, and look at the camera."""
        self._shown = True
        self.start.show_recent(self.context.settings.recent_sessions)
        if self.wizard is not None:
            self.wizard.enter()

    def leave(self) -> None:
        """Let the camera go."""
        self._shown = False
        if self.wizard is not None:
            self.wizard.leave()

    def may_close(self) -> bool:
        """Everything is on disk; work that runs is stopped."""
        self._close_wizard()
        return True

    def open_path(self, path: Path) -> None:
        """Open a session folder; where it is none, say why on the start view."""
        folder = path.parent if path.name == "session.toml" else path
        try:
            project = CalibrationProject(folder)
        except InputError as error:
            self._leave_session()
            self.start.show_problem(str(error))
            return
        self._show_wizard(project)

    # Ways to begin

    def begin(self) -> None:
        """Ask what is known of a new sensor; what was typed of it already stays."""
        self._close_wizard()
        if self._stack.currentWidget() is not self.form or not self.form.edited:
            self.form.show_session(self._proposal(), new=True)
        self._stack.setCurrentWidget(self.form)
        self.form.serial.setFocus()

    def begin_demo(self) -> None:
        """Begin on the virtual sensor."""
        self.context.requests.demo.emit()
        self.begin()
        self.form.show_session(self._proposal(), new=True)

    def choose_folder(self) -> None:
        """Let the person choose a session folder."""
        chosen = QFileDialog.getExistingDirectory(
            self, tr("Open a session folder"), str(self.context.settings.last_folder)
        )
        if chosen:
            self.context.settings.last_folder = Path(chosen).parent
            self.open_path(Path(chosen))

    def _proposal(self) -> Session:
        """Return what a new session states: of the virtual sensor it is known."""
        from app.bench.stated import stated_session

        info = self.context.source.info
        return stated_session() if info is not None and info.kind == "virtual" else new_session()

    def _on_source(self) -> None:
        """State what is known of the virtual sensor, where it is chosen in the form."""
        info = self.context.source.info
        in_form = self._stack.currentWidget() is self.form
        if in_form and info is not None and info.kind == "virtual":
            self.form.show_session(self._proposal(), new=True)

    def _create(self, stated: Session) -> None:
        name = datetime.now().astimezone().strftime("%Y-%m-%d-%H%M%S")
        folder = self.context.workspace.sessions_folder(stated.sensor.serial) / folder_name(name)
        try:
            create_session(replace(stated, folder=folder))
            project = CalibrationProject(folder)
        except InputError as error:
            self.form.show_problem(str(error))
            return
        self._show_wizard(project, step="lens")

    def _show_wizard(self, project: CalibrationProject, *, step: str = "") -> None:
        self._close_wizard()
        self.start.show_problem("")
        self.wizard = Wizard(project, context=self.context)
        self.wizard.left.connect(self._leave_session)
        self._stack.addWidget(self.wizard)
        self._stack.setCurrentWidget(self.wizard)
        self.context.settings.add_recent_session(project.session.folder)
        self.wizard.go_to(step or self.wizard.standing.first_open_step())
        if self._shown:
            self.wizard.enter()

    def _leave_session(self) -> None:
        self._close_wizard()
        self.start.show_problem("")
        self.start.show_recent(self.context.settings.recent_sessions)
        self._stack.setCurrentWidget(self.start)

    def _close_wizard(self) -> None:
        if self.wizard is not None:
            self.wizard.close_session()
            self._stack.removeWidget(self.wizard)
            self.wizard.deleteLater()
            self.wizard = None
