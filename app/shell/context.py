"""What every page is given: settings, workspace, status, messages, and where pictures come from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal

if TYPE_CHECKING:
    from app.cameras.desk import CameraDesk
    from app.shell.log import Log
    from app.shell.settings import Settings
    from app.shell.status import StatusModel
    from app.shell.toasts import Toasts
    from app.sources.bench import Bench
    from app.sources.source import SourceInfo
    from app.workspace.workspace import Workspace


class SourceChoice(QObject):
    """The source that is chosen; opening and closing it is the live pages' part.

    Attributes
    ----------
    info : SourceInfo or None
        The source.
    bench : Bench or None
        What lies on the virtual sensor; None until that was the source for the first time.
    """

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.info: SourceInfo | None = None
        self.bench: Bench | None = None

    def choose(self, info: SourceInfo | None) -> None:
        """Choose a source, or none."""
        if info is not self.info:
            self.info = info
            self.changed.emit()

    def choose_virtual_sensor(self) -> None:
        """Choose the virtual sensor; what lies on its bench stays there."""
        from app.sources.bench import Bench  # heavy: it knows the sensor's optics
        from app.sources.listing import virtual_sensor
        from gelpolight_core.design.sensor_design import SensorDesign

        if self.bench is None:
            self.bench = Bench(SensorDesign())
        if self.info is None or self.info.kind != "virtual":
            self.choose(*virtual_sensor(self.bench)())

    def choose_recording(self, file: Path) -> None:
        """Choose a recording, to be played from its beginning."""
        from app.sources.listing import recordings  # heavy, as above

        for info in recordings([file])():
            self.choose(info)

    def choose_folder(self, folder: Path) -> None:
        """Choose a folder of pictures, to be shown one after the other."""
        from app.sources.listing import picture_folders  # heavy, as above

        for info in picture_folders([folder])():
            self.choose(info)

    @property
    def remembered(self) -> tuple[str, Path | None]:
        """Kind and file of the source, by which it is chosen again; an empty kind: none."""
        return ("", None) if self.info is None else (self.info.kind, self.info.file)

    def choose_again(self, kind: str, file: Path | None) -> None:
        """Choose what was remembered, unless a source is chosen already; what is gone is not."""
        if self.info is not None:
            return
        if kind == "virtual":
            self.choose_virtual_sensor()
        elif kind == "folder" and file is not None:
            self.choose_folder(file)
        elif kind == "recording" and file is not None:
            self.choose_recording(file)


class Requests(QObject):
    """What a page asks of the window."""

    page = Signal(str)  # name: show that page
    path = Signal(str, str)  # name, path: show that page and let it open a folder or file
    session = Signal(str)  # folder: calibrate from it, and remember it
    choose_session = Signal()  # the same, with the folder still to be chosen by the person
    new_sensor = Signal()  # begin to calibrate another one; an open session is closed
    demo = Signal()  # put the virtual sensor in as the source
    begin_demo = Signal()  # that, and begin to calibrate it
    calibrations_changed = Signal()  # calibrations were added, removed, validated or put into use


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
    cameras: CameraDesk
