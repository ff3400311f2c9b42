"""What the program remembers between runs, in one INI file of the user's configuration."""

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
from gelpolight_core.export.atomic import cannot_write
from gelpolight_core.reading import read_file

APPLICATION = "gelpolight"
THEMES = ("system", "light", "dark")
RECENT = 8
CAMERAS = 16
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Limits:
    """Where the program begins to warn.

    Attributes
    ----------
    age_days : float
        A calibration older than this is marked: gel yellows and hardens in months.
    height_percent, size_percent : float
        Largest error of an object of known size for a validation to pass: what the paper reports
        of its own sensor, 8 % in depth and 5 % in the plane.
    """

    age_days: float = 90.0
    height_percent: float = 8.0
    size_percent: float = 5.0


# How an INI file of Qt spells objects; one of Python's is made by running what it says.
OBJECTS = re.compile(rb"@(Variant|DateTime)\(", re.IGNORECASE)
SIZE_LIMIT = 10_000_000


def _keep_aside_what_is_no_text(path: Path) -> None:
    """Begin anew where a settings file holds more than texts, numbers and layouts."""
    try:
        spoilt = OBJECTS.search(read_file(path, SIZE_LIMIT)) is not None
    except FileNotFoundError:
        return
    except InputError:
        spoilt = True
    if spoilt:
        aside = path.with_name(f"{path.name}.refused")
        _LOG.warning("%s holds what no settings are; it is kept as %s", path, aside.name)
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
    def workspace_folder(self) -> Path:
        """Where sensors are kept."""
        chosen = self._text("workspace")
        return Path(chosen) if chosen else default_folder()

    @workspace_folder.setter
    def workspace_folder(self, folder: Path) -> None:
        self._store.setValue("workspace", str(folder))

    @property
    def last_folder(self) -> Path:
        """Where a file dialog begins."""
        folder = Path(self._text("last_folder") or Path.home())
        return folder if folder.is_dir() else Path.home()

    @last_folder.setter
    def last_folder(self, folder: Path) -> None:
        self._store.setValue("last_folder", str(folder))

    @property
    def last_page(self) -> str:
        """Name of the page that was shown last."""
        return self._text("last_page")

    @last_page.setter
    def last_page(self, name: str) -> None:
        self._store.setValue("last_page", name)

    @property
    def recent_sessions(self) -> tuple[Path, ...]:
        """Session folders, newest first."""
        stored = self._text("recent_sessions")
        return tuple(Path(text) for text in stored.split("\n") if text)

    def add_recent_session(self, folder: Path) -> None:
        """Put a session folder at the top of the recent ones."""
        known = [folder, *(f for f in self.recent_sessions if f != folder)][:RECENT]
        self._store.setValue("recent_sessions", "\n".join(map(str, known)))

    def forget_recent_sessions(self) -> None:
        """Empty the list of recent sessions."""
        self._store.remove("recent_sessions")

    @property
    def source(self) -> tuple[str, Path | None]:
        """Kind and file of the source that was chosen last; an empty kind: none was."""
        file = self._text("source/file")
        return self._text("source/kind"), Path(file) if file else None

    @source.setter
    def source(self, chosen: tuple[str, Path | None]) -> None:
        kind, file = chosen
        self._store.setValue("source/kind", kind)
        self._store.setValue("source/file", "" if file is None else str(file))

    @property
    def limits(self) -> Limits:
        """Where the program begins to warn; a value that is no number counts as not set."""
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
    def reconstruction(self) -> tuple[str, str]:
        """Model and effort of the live depth; whether there are such is for who uses them."""
        model, _, effort = self._text("reconstruction", "full/fast").partition("/")
        return model, effort

    @reconstruction.setter
    def reconstruction(self, way: tuple[str, str]) -> None:
        self._store.setValue("reconstruction", "/".join(way))

    def _cameras(self) -> dict[str, dict[str, str]]:
        try:
            stored = json.loads(self._text("cameras", "{}"))
        except (ValueError, RecursionError):  # edited by hand: as if nothing were known
            return {}
        return stored if isinstance(stored, dict) else {}

    def camera(self, identity: str) -> dict[str, str]:
        """Return how a camera was set last, as texts; empty where it is not known."""
        stored = self._cameras().get(identity, {})
        return stored if isinstance(stored, dict) else {}

    def keep_camera(self, identity: str, texts: Mapping[str, str]) -> None:
        """Remember how a camera is set; those set longest ago are forgotten."""
        others = {key: value for key, value in self._cameras().items() if key != identity}
        kept = [*others.items(), (identity, dict(texts))][-CAMERAS:]
        self._store.setValue("cameras", json.dumps(dict(kept)))

    def window_state(self) -> tuple[QByteArray, QByteArray]:
        """Return geometry and state of the main window; empty at first."""
        none = QByteArray()
        geometry = self._store.value("window/geometry", none)
        state = self._store.value("window/state", none)
        return (
            geometry if isinstance(geometry, QByteArray) else none,
            state if isinstance(state, QByteArray) else none,
        )

    def keep_window_state(self, geometry: QByteArray, state: QByteArray) -> None:
        """Remember geometry and state of the main window."""
        self._store.setValue("window/geometry", geometry)
        self._store.setValue("window/state", state)

    def layout(self, page: str) -> QByteArray:
        """Return the layout of a page's views; empty at first."""
        stored = self._store.value(f"layout/{page}", QByteArray())
        return stored if isinstance(stored, QByteArray) else QByteArray()

    def keep_layout(self, page: str, state: QByteArray) -> None:
        """Remember the layout of a page's views."""
        self._store.setValue(f"layout/{page}", state)

    @property
    def look(self) -> str:
        """How depth is shown, as text that the views understand; empty at first."""
        return self._text("look")

    @look.setter
    def look(self, text: str) -> None:
        self._store.setValue("look", text)

    def save(self) -> None:
        """Write the file now."""
        self._store.sync()
