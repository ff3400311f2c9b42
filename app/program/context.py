"""What every page gets: settings, workspace, status, messages and the image source."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Signal

if TYPE_CHECKING:
    from app.sources.source import SourceInfo
    from app.sources.virtual_bench import VirtualBench

    from .camera_manager import CameraManager
    from .display import DisplayStore
    from .log import Log
    from .settings import AppSettings
    from .status import StatusModel
    from .toasts import Toasts
    from .workspace import Workspace


class SourceSelection(QObject):
    """The selected source. The live pages open and close it.

    Attributes
    ----------
    info : SourceInfo or None
        The source.
    bench : VirtualBench or None
        The objects on the virtual sensor. None until the virtual sensor is first selected.
    kept : dict of str to object
        What a page leaves for the next one that opens the source: position and colour range.
    """

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.info: SourceInfo | None = None
        self.bench: VirtualBench | None = None
        self.kept: dict[str, Any] = {}

    def choose(self, info: SourceInfo | None) -> None:
        """Select a source, or none."""
        if info is not self.info:
            self.info, self.kept = info, {}
            self.changed.emit()

    def choose_virtual_sensor(self) -> VirtualBench:
        """Select the virtual sensor, and return its bench. The objects on it are kept."""
        from app.sources.source_list import virtual_sensor
        from app.sources.virtual_bench import VirtualBench

        from .prepare import virtual_design  # slow imports: load the sensor's optics

        if self.bench is None:
            self.bench = VirtualBench(virtual_design())
        if self.virtual is None:
            self.choose(virtual_sensor(self.bench))
        return self.bench

    def choose_recording(self, file: Path) -> None:
        """Select a recording and play it from the start."""
        from app.sources.source_list import recording  # slow import, as above

        if file.is_file():
            self.choose(recording(file))

    def choose_folder(self, folder: Path) -> None:
        """Select a folder of images and show them one after the other."""
        from app.sources.source_list import image_folder  # slow import, as above

        if folder.is_dir():
            self.choose(image_folder(folder))

    @property
    def virtual(self) -> VirtualBench | None:
        """The bench of the virtual sensor, if that is the source."""
        return self.bench if self.info is not None and self.info.kind == "virtual" else None

    @property
    def remembered(self) -> tuple[str, str]:
        """Kind and place of the source, enough to select it again. An empty kind means none.

        The place is a file, a folder or the identity of a camera.
        """
        if self.info is None:
            return "", ""
        place = self.info.detail if self.info.kind == "camera" else str(self.info.file or "")
        return self.info.kind, place

    def choose_again(self, kind: str, place: str, cameras: CameraManager) -> None:
        """Select the remembered source if it still exists and none is selected."""
        if self.info is not None:
            return
        if kind == "virtual":
            self.choose_virtual_sensor()
        elif kind == "folder" and place:
            self.choose_folder(Path(place))
        elif kind == "recording" and place:
            self.choose_recording(Path(place))
        elif kind == "camera":
            for camera in cameras.infos():
                if cameras.is_same(place, camera.detail):
                    self.choose(camera)


class PageRequests(QObject):
    """Requests from a page to the main window."""

    page = Signal(str)  # name: show that page
    session = Signal(str)  # folder: calibrate from it and remember it
    guide = Signal(str, str)  # page, anchor of a heading: open the guide there
    # "sensor": start another calibration; "demo", "press", "measure", "practice": show, press,
    # measure and calibrate with the virtual sensor; "source", "session", "files": let the user
    # choose them, and open them.
    begin = Signal(str)
    preferences_changed = Signal()  # the mode of the live depth, or a limit
    calibrations_changed = Signal()  # calibrations added, removed, validated or put into use


@dataclass(frozen=True, slots=True)
class AppContext:
    """Passed to every page as the keyword ``context``."""

    settings: AppSettings
    display: DisplayStore
    workspace: Workspace
    status: StatusModel
    toasts: Toasts
    source: SourceSelection
    requests: PageRequests
    log: Log
    cameras: CameraManager
