"""The files of a session folder, each looked into at most once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.safe_reading import read_toml
from gelpolight_core.image.image_file import decode_image, files_in, format_of, read_image_file

from .file_hashes import file_hash

DESCRIPTION = "session.toml"
IN_PLACE = "in_place"
"""Table of session.toml that a closed sensor has, and no other."""
SYSTEM_FILES = "thumbs.db", "ehthumbs.db", "desktop.ini"
"""Files that Windows writes into any folder, in lower case. Those of other systems are hidden."""


@dataclass(frozen=True)
class StoredImage:
    """An image file of a session. What needs its content is read when it is first asked for.

    Attributes
    ----------
    path : Path
        The file.
    size_bytes, changed_ns : int
        Size and time of the last change, which recognise a changed file.
    """

    path: Path
    size_bytes: int
    changed_ns: int

    @classmethod
    def of(cls, path: Path) -> StoredImage:
        """Return the present file of a path. A missing one is refused when it is read."""
        try:
            stat = path.stat()
        except OSError:
            return cls(path, 0, 0)
        return cls(path, stat.st_size, stat.st_mtime_ns)

    @property
    def name(self) -> str:
        """Folder and file name, such as ``balls/ball_03.png``."""
        return f"{self.path.parent.name}/{self.path.name}"

    @cached_property
    def sha256(self) -> str:
        """Hash of the file as hexadecimal text."""
        return file_hash(self.path)

    @cached_property
    def compression(self) -> tuple[str, float]:
        """Format of the file, and standard deviation by its compression in grey levels of 8 bit."""
        form = format_of(data := read_image_file(self.path))
        return ("", 0.0) if form is None else (form.name, form.loss(data))

    @cached_property
    def size_px(self) -> tuple[int, int] | None:
        """Width and height of the image, or None if it cannot be read."""
        try:
            rows, columns = decode_image(self.path)[0].shape[:2]
        except InputError:
            return None
        return columns, rows


class StageFiles(NamedTuple):
    """The files of a stage's folder by their names, without hidden and system files."""

    images: tuple[StoredImage, ...]
    others: tuple[Path, ...]


@dataclass(frozen=True)
class SessionInventory:
    """The content of a session folder: its description, and the files of its stages.

    The description and each stage are read when they are first asked for, and then stay the same:
    all that use one inventory see the same files.

    Attributes
    ----------
    folder : Path
        The session folder. It need not exist.
    content : mapping, optional
        Content of session.toml where it is known; by default it is read.
    """

    folder: Path
    content: Mapping[str, Any] | None = field(default=None, repr=False)
    _stages: dict[str, StageFiles] = field(default_factory=dict, repr=False)

    @property
    def path(self) -> Path:
        """The path of session.toml."""
        return self.folder / DESCRIPTION

    @cached_property
    def description(self) -> Mapping[str, Any]:
        """The content of session.toml. InputError if it is missing or not TOML."""
        missing = InputError(f"There is no {DESCRIPTION}", self.folder, Remedy.CHOOSE_SESSION)
        return read_toml(self.path, missing=missing) if self.content is None else self.content

    @property
    def closed(self) -> bool:
        """Whether the description is of a closed sensor."""
        return IN_PLACE in self.description

    def stage(self, name: str) -> StageFiles:
        """Return the files of a stage. There are none without its folder.

        Raises
        ------
        InputError
            If the folder cannot be listed.
        """
        if name not in self._stages:
            self._stages[name] = _listed(self.folder / name, {})
        return self._stages[name]

    def refreshed(self) -> SessionInventory:
        """Return the inventory of the present files. Unchanged ones keep what is known of them."""
        before = dict(self._stages)  # another thread may ask for a further stage
        images = {image: image for files in before.values() for image in files.images}
        stages = {name: _listed(self.folder / name, images) for name in before}
        return self if stages == before else replace(self, _stages=stages)


def _listed(folder: Path, before: Mapping[StoredImage, StoredImage]) -> StageFiles:
    """Return the files of a folder. Images that are as before keep what is known of them."""
    paths, others = files_in(folder)
    return StageFiles(
        tuple(before.get(image, image) for image in map(StoredImage.of, paths)),
        tuple(path for path in others if path.name.lower() not in SYSTEM_FILES),
    )
