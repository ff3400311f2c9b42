"""The Start page: continue the last session, use the last calibration, or begin something new."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QIcon, QImageReader, QPixmap
from PySide6.QtWidgets import QCommandLinkButton, QWidget

from app.program.calibration_entries import CalibrationEntry
from app.program.calibration_status import put_into_use
from app.program.context import AppContext
from app.program.first_steps import FirstSteps
from app.program.session_entries import SessionEntry, unfinished_sessions
from app.widgets.icons import icon
from app.widgets.layout import hbox, scroll_area, vbox
from app.widgets.text_roles import heading
from app.widgets.widget_names import set_names
from gelpolight_core.calibration.recipes import stage_title

# Larger images are not decoded here: the window must be up at once.
MOST_BYTES = 40_000_000
IMAGE = QSize(96, 64)


class StartPage(QWidget):
    """Offers the first actions of a technician.

    Parameters
    ----------
    context : AppContext
        Shared by all pages.
    """

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()
        set_names(self, "home", "Start")
        self._context = context
        self._session: SessionEntry | None = None
        self._calibration: CalibrationEntry | None = None
        title = heading("What do you want to do?", size=1.5)
        self.go_on = ActionCard("home.continue", "&Continue the calibration", "calibrate")
        self.go_on.clicked.connect(self._continue)
        self.use = ActionCard("home.inspect", "&Inspect with the calibration", "inspect")
        self.use.clicked.connect(self._inspect)
        self.new = self._card("home.new", "Calibrate a &new sensor", "add", "sensor")
        self.new.show_message("From its camera, step by step")
        self.open = self._card("home.open", "&Open files…", "folder", "files")
        self.open.show_message("A session, a calibration or a recording")
        self.demo = self._card("home.demo", "&Try the virtual sensor", "demo", "demo")
        self.demo.show_message("All functions, without a camera")
        self.first_steps = FirstSteps(context=context)
        middle = QWidget(self, maximumWidth=620)
        cards = self.go_on, self.use, self.new, self.open, self.demo, self.first_steps
        vbox(None, title, 8, *cards, (None, 2), of=middle, spacing=10)
        inner = QWidget()
        hbox(None, (middle, 6), None, of=inner)
        vbox(set_names(scroll_area(inner), "home.area", "Start"), of=self, margins=0)
        context.requests.calibrations_changed.connect(self.refresh)
        self.refresh()

    def enter(self) -> None:
        """Read the workspace again."""
        self.refresh()
        first = next(card for card in (self.go_on, self.use, self.new) if not card.isHidden())
        first.setFocus()

    def refresh(self) -> None:
        """Show what can be continued and used."""
        entries: tuple[CalibrationEntry, ...] = ()
        sessions: tuple[SessionEntry, ...] = ()
        with self._context.toasts.errors():
            entries = self._context.workspace.entries()
            sessions = self._context.workspace.sessions()
        open_sessions = unfinished_sessions(sessions, entries)
        self._session = max(open_sessions, key=lambda s: s.changed, default=None)
        self._calibration = last_calibration(entries)
        self.go_on.setVisible(self._session is not None)
        self.use.setVisible(self._calibration is not None)
        self.demo.setHidden(self.first_steps.offer(not entries and not sessions))
        if self._session is not None:
            self.go_on.show_message(session_text(self._session))
            self.go_on.show_image(_image(self._session))
        if self._calibration is not None:
            self.use.show_message(calibration_text(self._calibration))

    def _card(self, name: str, title: str, sign: str, begin: str) -> ActionCard:
        card = ActionCard(name, title, sign)
        card.clicked.connect(lambda _=False: self._context.requests.begin.emit(begin))
        return card

    def _continue(self) -> None:
        if self._session is not None:
            self._context.requests.session.emit(str(self._session.folder))

    def _inspect(self) -> None:
        entry = self._calibration
        if entry is None:
            return
        if not entry.in_use:
            put_into_use(entry.path, self, context=self._context)
        self._context.requests.page.emit("inspect")


def last_calibration(entries: Sequence[CalibrationEntry]) -> CalibrationEntry | None:
    """Return the calibration in use, otherwise the newest one that did not fail."""
    good = [entry for entry in entries if entry.summary is not None and entry.created is not None]
    used = [entry for entry in good if entry.in_use]
    sound = [entry for entry in good if not entry.failed]
    return max(used or sound, key=lambda entry: entry.created or datetime.min, default=None)


def session_text(session: SessionEntry) -> str:
    """Return the sensor, the next step and the age of a session."""
    step = session.next_stage
    step_text = f"next: {stage_title(step)}" if step else "all images captured"
    return (
        f"Sensor {session.serial}, {step_text}\n{session.images} "
        f"images, last changed {_when(session.changed)}"
    )


def calibration_text(entry: CalibrationEntry) -> str:
    """Return the name, age and state of a calibration."""
    assert entry.summary is not None and entry.created is not None
    return (
        f"Sensor {entry.serial}, {entry.summary.verdict.word.lower()}, "
        f"{entry.state[0]}\n{entry.name}, made {_when(entry.created)}"
    )


def _when(time: datetime) -> str:
    local, now = time.astimezone(), datetime.now().astimezone()
    if local.date() == now.date():
        return f"today at {local:%H:%M}"
    return f"{local:%Y-%m-%d %H:%M}"


def _image(session: SessionEntry) -> QPixmap | None:
    """Return the newest image of a session, or None if it is missing, too large or not readable."""
    if session.newest is None:
        return None
    reader = QImageReader(str(session.newest))
    size = reader.size()
    if not size.isValid() or 4 * size.width() * size.height() > MOST_BYTES:
        return None
    reader.setScaledSize(size.scaled(IMAGE * 2, Qt.AspectRatioMode.KeepAspectRatio))
    return QPixmap.fromImageReader(reader)


class ActionCard(QCommandLinkButton):
    """One action of the Start page.

    Parameters
    ----------
    name : str
        Object name.
    title : str
        What a click does.
    sign : str
        Name of the icon that is shown while there is no image.
    """

    def __init__(self, name: str, title: str, sign: str) -> None:
        super().__init__(title, "")
        set_names(self, name, title.replace("&", ""))
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self._sign = sign
        self.show_image(None)

    def show_message(self, text: str) -> None:
        """Show lines of text below the title."""
        self.setDescription(text)
        self.setAccessibleDescription(text)

    def show_image(self, image: QPixmap | None) -> None:
        """Show an image, or the sign."""
        none = image is None or image.isNull()
        self.setIcon(icon(self._sign) if image is None or none else QIcon(image))
        self.setIconSize(QSize(28, 28) if none else IMAGE)
