"""Settings that the program keeps between runs, in one INI file of the user."""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from PySide6.QtCore import QByteArray, QSettings

from gelpolight_core.base.atomic_write import cannot_write
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.safe_reading import read_file

from .preferences import (
    MOST_BYTES,
    Preferences,
    StoredT,
    WarningLimits,
    read_stored_settings,
    settings_file,
)
from .workspace import default_folder

RECENT = 8
RECENT_KINDS = ("sessions", "calibrations", "recordings")
CAMERAS = 16
_LOG = logging.getLogger(__name__)


# How an INI file of Qt stores objects. Reading a Python object would execute its content.
OBJECTS = re.compile(rb"@(Variant|DateTime)\(", re.IGNORECASE)


def _keep_aside_what_is_no_text(path: Path) -> None:
    """Start with empty settings if the file contains anything but text, numbers and layouts."""
    try:
        spoilt = OBJECTS.search(read_file(path, MOST_BYTES)) is not None
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


class AppSettings:
    """Typed access to the settings file."""

    def __init__(self, path: Path | None = None) -> None:
        self.path = path or settings_file()
        _keep_aside_what_is_no_text(self.path)
        self._store = QSettings(str(self.path), QSettings.Format.IniFormat)

    def _text(self, key: str, default: str = "") -> str:
        return str(self._store.value(key, default))

    def _bytes(self, key: str) -> QByteArray:
        stored = self._store.value(key)
        return stored if isinstance(stored, QByteArray) else QByteArray()

    @property
    def preferences(self) -> Preferences:
        """What the user prefers."""
        return self._read(Preferences, "")

    def prefer(self, **values: str | float) -> None:
        """Change some of the preferences."""
        self._keep(values, "")

    @property
    def limits(self) -> WarningLimits:
        """Limits for warnings."""
        return self._read(WarningLimits, "limits/")

    @limits.setter
    def limits(self, limits: WarningLimits) -> None:
        self._keep(asdict(limits), "limits/")

    def _read(self, kind: type[StoredT], group: str) -> StoredT:
        return read_stored_settings(kind, lambda name: self._text(group + name))

    def _keep(self, values: Mapping[str, str | float], group: str) -> None:
        for name, value in values.items():
            text = {True: "yes", False: "no"}[value] if isinstance(value, bool) else value
            self._store.setValue(group + name, text)

    @property
    def workspace_folder(self) -> Path:
        """Folder that contains the sensors."""
        folder = self.preferences.workspace
        return Path(folder) if folder else default_folder()

    def folder(self, kind: str) -> Path:
        """Return the folder in which file dialogs of a kind start."""
        folder = Path(self._text(f"folders/{kind}") or Path.home())
        return folder if folder.is_dir() else Path.home()

    def keep_folder(self, kind: str, folder: Path) -> None:
        """Remember the folder that was chosen in a file dialog of a kind."""
        self._store.setValue(f"folders/{kind}", str(folder))

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
        paths = [path, *(other for other in self.recent(kind) if other != path)][:RECENT]
        self._store.setValue(f"recent_{kind}", "\n".join(map(str, paths)))

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
        newest = [*others.items(), (identity, dict(texts))][-CAMERAS:]
        self._store.setValue("cameras", json.dumps(dict(newest)))

    def camera_notes(self, kind: str) -> tuple[str, ...]:
        """Return what is known about identities of cameras: those ``shared``, or the ``same``."""
        return tuple(filter(None, self._text(f"cameras_{kind}").split("\n")))

    def keep_camera_note(self, kind: str, text: str) -> None:
        """Remember it. The oldest notes are dropped."""
        notes = dict.fromkeys((*self.camera_notes(kind), text))
        self._store.setValue(f"cameras_{kind}", "\n".join(list(notes)[-CAMERAS:]))

    def window_state(self) -> tuple[QByteArray, QByteArray]:
        """Return geometry and state of the main window. Empty at first."""
        return self._bytes("window/geometry"), self._bytes("window/state")

    def keep_window_state(self, geometry: QByteArray, state: QByteArray) -> None:
        """Save geometry and state of the main window."""
        self._store.setValue("window/geometry", geometry)
        self._store.setValue("window/state", state)

    def display(self, name: str) -> str:
        """Return the display settings of a view, as text for that view. Empty at first."""
        return self._text(name)

    def keep_display(self, name: str, text: str) -> None:
        """Save the display settings of a view: ``display``, ``inspect_layout``, ..."""
        self._store.setValue(name, text)

    def save(self) -> None:
        """Write the file now."""
        self._store.sync()
