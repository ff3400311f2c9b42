"""Settings that the program keeps between runs, in one INI file of the user."""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path

import platformdirs
from PySide6.QtCore import QByteArray, QSettings

from app.workspace.workspace import default_folder
from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import cannot_write
from gelpolight_core.io.reading import read_file
from gelpolight_core.translation import LANGUAGES

APPLICATION = "gelpolight"
THEMES = ("system", "light", "dark")
RECENT = 8
RECENT_KINDS = ("sessions", "calibrations", "recordings")
# About ten minutes of a fast camera.
RECORDING_LIMIT_GB = 20.0
CAMERAS = 16
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits for warnings.

    Attributes
    ----------
    age_days : float
        An older calibration is marked: gel yellows and hardens within months.
    height_percent, size_percent : float
        Maximum error of an object of known size to pass validation. The defaults are the errors
        that the paper reports for its own sensor: 8 % in depth and 5 % in the plane.
    """

    age_days: float = 90.0
    height_percent: float = 8.0
    size_percent: float = 5.0


# Each kind of file dialog remembers a folder of its own.
FOLDER_KINDS = (
    "session", "calibration", "recording", "images", "press", "height_map", "table", "report",
    "picture",
)  # fmt: skip


# How an INI file of Qt stores objects. Reading a Python object would execute its content.
OBJECTS = re.compile(rb"@(Variant|DateTime)\(", re.IGNORECASE)
SIZE_LIMIT = 10_000_000


def _keep_aside_what_is_no_text(path: Path) -> None:
    """Start with empty settings if the file contains anything but text, numbers and layouts."""
    try:
        spoilt = OBJECTS.search(read_file(path, SIZE_LIMIT)) is not None
    except FileNotFoundError:
        return
    except InputError:
        spoilt = True
    if spoilt:
        aside = path.with_name(f"{path.name}.refused")
        _LOG.warning("%s contains invalid settings. It is kept as %s", path, aside.name)
        try:
            path.replace(aside)
        except OSError as error:
            raise cannot_write(error, path) from error


class Settings:
    """Typed access to the settings file."""

    def __init__(self, path: Path | None = None) -> None:
        self.path = path or platformdirs.user_config_path(APPLICATION) / "desktop.ini"
        _keep_aside_what_is_no_text(self.path)
        self._store = QSettings(str(self.path), QSettings.Format.IniFormat)

    def _text(self, key: str, default: str = "") -> str:
        return str(self._store.value(key, default))

    @property
    def theme(self) -> str:
        """One of THEMES."""
        theme = self._text("theme", "system")
        return theme if theme in THEMES else "system"

    @theme.setter
    def theme(self, theme: str) -> None:
        self._store.setValue("theme", theme)

    @property
    def language(self) -> str:
        """A key of LANGUAGES. Empty: the language of the system."""
        language = self._text("language")
        return language if language in LANGUAGES else ""

    @language.setter
    def language(self, language: str) -> None:
        self._store.setValue("language", language)

    @property
    def workspace_folder(self) -> Path:
        """Folder that contains the sensors."""
        chosen = self._text("workspace")
        return Path(chosen) if chosen else default_folder()

    @workspace_folder.setter
    def workspace_folder(self, folder: Path) -> None:
        self._store.setValue("workspace", str(folder))

    def folder(self, kind: str) -> Path:
        """Return the folder in which file dialogs of a kind start.

        Parameters
        ----------
        kind : str
            One of FOLDER_KINDS.
        """
        folder = Path(self._text(_folder_key(kind)) or Path.home())
        return folder if folder.is_dir() else Path.home()

    def keep_folder(self, kind: str, folder: Path) -> None:
        """Remember the folder that was chosen in a file dialog of a kind."""
        self._store.setValue(_folder_key(kind), str(folder))

    @property
    def last_page(self) -> str:
        """Name of the page that was shown last."""
        return self._text("last_page")

    @last_page.setter
    def last_page(self, name: str) -> None:
        self._store.setValue("last_page", name)

    @property
    def first_page(self) -> str:
        """Name of the page that is shown first: the Start page, or the last one if preferred."""
        return self.last_page if self.starts_where_it_ended else "start"

    @property
    def starts_where_it_ended(self) -> bool:
        """Whether the program starts with the page that was shown last."""
        return self._text("first_page") == "last"

    @starts_where_it_ended.setter
    def starts_where_it_ended(self, last: bool) -> None:
        self._store.setValue("first_page", "last" if last else "start")

    def recent(self, kind: str) -> tuple[Path, ...]:
        """Return the files of a kind that were used last, newest first.

        Parameters
        ----------
        kind : str
            One of RECENT_KINDS.
        """
        stored = self._text(f"recent_{kind}")
        return tuple(Path(text) for text in stored.split("\n") if text)

    def add_recent(self, kind: str, path: Path) -> None:
        """Put a file or session folder at the top of the recent ones of its kind."""
        known = [path, *(other for other in self.recent(kind) if other != path)][:RECENT]
        self._store.setValue(f"recent_{kind}", "\n".join(map(str, known)))

    def forget_recent(self) -> None:
        """Clear the lists of recent files."""
        for kind in RECENT_KINDS:
            self._store.remove(f"recent_{kind}")

    @property
    def source(self) -> tuple[str, str]:
        """Kind and place of the source that was selected last. An empty kind: none."""
        return self._text("source/kind"), self._text("source/file")

    @source.setter
    def source(self, chosen: tuple[str, str]) -> None:
        for key, value in zip(("kind", "file"), chosen, strict=True):
            self._store.setValue(f"source/{key}", value)

    @property
    def limits(self) -> Limits:
        """Limits for warnings. A value that is not a number is ignored."""
        default = Limits()
        values = {}
        for field in fields(Limits):
            standard = getattr(default, field.name)
            try:
                value = float(self._text(f"limits/{field.name}", str(standard)))
            except ValueError:
                value = standard
            values[field.name] = value if 0.0 < value < 1e6 else standard
        return Limits(**values)

    @limits.setter
    def limits(self, limits: Limits) -> None:
        for field in fields(Limits):
            self._store.setValue(f"limits/{field.name}", getattr(limits, field.name))

    @property
    def recording_limit_gb(self) -> float:
        """Largest size of a recording, in 10^9 bytes. A value that is not a number is ignored."""
        try:
            value = float(self._text("recording_limit_gb", str(RECORDING_LIMIT_GB)))
        except ValueError:
            return RECORDING_LIMIT_GB
        return value if 0.0 < value < 1e6 else RECORDING_LIMIT_GB

    @recording_limit_gb.setter
    def recording_limit_gb(self, limit_gb: float) -> None:
        self._store.setValue("recording_limit_gb", limit_gb)

    @property
    def captures_automatically(self) -> bool:
        """Whether the wizard captures good images by itself, and goes on by itself."""
        return self._text("captures_automatically") != "no"

    @captures_automatically.setter
    def captures_automatically(self, on: bool) -> None:
        self._store.setValue("captures_automatically", "yes" if on else "no")

    @property
    def reconstruction(self) -> tuple[str, str]:
        """Model and effort of the live depth. The caller checks that they exist."""
        model, _, effort = self._text("reconstruction", "full/fast").partition("/")
        return model, effort

    @reconstruction.setter
    def reconstruction(self, mode: tuple[str, str]) -> None:
        self._store.setValue("reconstruction", "/".join(mode))

    @property
    def length_unit(self) -> str:
        """Unit in which measured lengths are shown: ``mm`` or ``um``."""
        return "um" if self._text("length_unit") == "um" else "mm"

    @length_unit.setter
    def length_unit(self, unit: str) -> None:
        self._store.setValue("length_unit", unit)

    def _cameras(self) -> dict[str, dict[str, str]]:
        try:
            stored = json.loads(self._text("cameras", "{}"))
        except (ValueError, RecursionError):  # edited by hand: treat as not set
            return {}
        return stored if isinstance(stored, dict) else {}

    def camera(self, identity: str) -> dict[str, str]:
        """Return the last settings of a camera as text. Empty if they are not known."""
        stored = self._cameras().get(identity, {})
        return stored if isinstance(stored, dict) else {}

    def keep_camera(self, identity: str, texts: Mapping[str, str]) -> None:
        """Remember the settings of a camera. The oldest entries are dropped."""
        others = {key: value for key, value in self._cameras().items() if key != identity}
        kept = [*others.items(), (identity, dict(texts))][-CAMERAS:]
        self._store.setValue("cameras", json.dumps(dict(kept)))

    def camera_notes(self, kind: str) -> tuple[str, ...]:
        """Return what is known about identities of cameras: those ``shared``, or the ``same``."""
        return tuple(filter(None, self._text(f"cameras_{kind}").split("\n")))

    def keep_camera_note(self, kind: str, text: str) -> None:
        """Remember it. The oldest notes are dropped."""
        notes = dict.fromkeys((*self.camera_notes(kind), text))
        self._store.setValue(f"cameras_{kind}", "\n".join(list(notes)[-CAMERAS:]))

    def window_state(self) -> tuple[QByteArray, QByteArray]:
        """Return geometry and state of the main window. Empty at first."""
        none = QByteArray()
        geometry = self._store.value("window/geometry", none)
        state = self._store.value("window/state", none)
        return (
            geometry if isinstance(geometry, QByteArray) else none,
            state if isinstance(state, QByteArray) else none,
        )

    def keep_window_state(self, geometry: QByteArray, state: QByteArray) -> None:
        """Save geometry and state of the main window."""
        self._store.setValue("window/geometry", geometry)
        self._store.setValue("window/state", state)

    def layout(self, page: str) -> QByteArray:
        """Return the layout of a page's views. Empty at first."""
        stored = self._store.value(f"layout/{page}", QByteArray())
        return stored if isinstance(stored, QByteArray) else QByteArray()

    def keep_layout(self, page: str, state: QByteArray) -> None:
        """Save the layout of a page's views."""
        self._store.setValue(f"layout/{page}", state)

    def display(self, name: str) -> str:
        """Return the display settings of a view, as text for that view. Empty at first."""
        return self._text(name)

    def keep_display(self, name: str, text: str) -> None:
        """Save the display settings of a view: ``look``, ``view3d``, ``viewpoints``, ..."""
        self._store.setValue(name, text)

    def save(self) -> None:
        """Write the file now."""
        self._store.sync()


def _folder_key(kind: str) -> str:
    if kind not in FOLDER_KINDS:
        raise ValueError(f"no kind of file dialog: {kind}")
    return f"folders/{kind}"
