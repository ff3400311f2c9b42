"""What every page is given: settings, workspace, status, messages, and where pictures come from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal

if TYPE_CHECKING:
    from app.shell.log import Log
    from app.shell.settings import Settings
    from app.shell.status import StatusModel
    from app.shell.toasts import Toasts
    from app.sources.source import SourceInfo
    from app.workspace.workspace import Workspace


class SourceChoice(QObject):
    """The source that is chosen; opening and closing it is the live pages' part."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.info: SourceInfo | None = None

    def choose(self, info: SourceInfo | None) -> None:
        """Choose a source, or none."""
        if info is not self.info:
            self.info = info
            self.changed.emit()


class Requests(QObject):
    """What a page asks of the window."""

    page = Signal(str)  # name: show that page
    path = Signal(str, str)  # name, path: show that page and let it open a folder or file
    session = Signal(str)  # folder: calibrate from it, and remember it
    choose_session = Signal()  # the same, with the folder still to be chosen by the person
    demo = Signal()  # put the virtual sensor in as the source, and begin
    library_changed = Signal()  # calibrations were added, removed, validated or put into use


@dataclass(frozen=True, slots=True)
class AppContext:
    """Passed to every page by the keyword ``context``."""

    settings: Settings
    workspace: Workspace
    status: StatusModel
    toasts: Toasts
    source: SourceChoice
    requests: Requests
    log: Log
    demo: bool = False
