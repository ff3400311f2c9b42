"""The settings of a run, stored in its folder; they must not change there."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from gelpolight_core import __version__
from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.io.reading import parse_json, read_file, unreadable
from gelpolight_core.translation import tr

FILE = "batch.json"
FORMAT = "gelpolight-batch"
VERSION = 1


@dataclass(frozen=True, slots=True)
class BatchSettings:
    """Settings for every frame of a run.

    Attributes
    ----------
    calibration : Path
        Its file, as every worker finds it; it may move if its identity stays.
    identity : str
        Identity of the calibration.
    model, effort : str
        As for :class:`~gelpolight_core.reconstruction.reconstructor.Reconstructor`.
    formats : tuple of str
        Out of :data:`~gelpolight_core.export.heightmap_files.FORMATS`.
    shape : str or None
        The shape measured in every frame; None for no measurement.
    program : str
        Version of the program.
    """

    calibration: Path
    identity: str
    model: str
    effort: str
    formats: tuple[str, ...]
    shape: str | None = None
    program: str = __version__

    def as_json(self) -> dict[str, Any]:
        """Return the settings that affect the results as plain values."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "calibration_id": self.identity,
            "model": self.model,
            "effort": self.effort,
            "formats": list(self.formats),
            "measure": self.shape,
            "program": self.program,
        }


def begin_or_go_on(settings: BatchSettings, out: Path) -> None:
    """Write the settings of a new run, or compare them with those of an existing run.

    Raises
    ------
    InputError
        If the run in the folder was started with other settings, or the file cannot be read or
        written.
    """
    if (out / FILE).exists():
        require_same(settings, out)
        return
    text = json.dumps(settings.as_json(), indent=1) + "\n"

    def write(stream: BinaryIO) -> None:
        stream.write(text.encode())

    write_atomically(out / FILE, write)


def require_same(settings: BatchSettings, out: Path) -> None:
    """Refuse settings that differ from those of the run in a folder.

    Raises
    ------
    InputError
        If the folder contains no run, its file is damaged, or a setting differs.
    """
    begun = _read(out / FILE)
    wanted = settings.as_json()
    other = [key for key in wanted if begun.get(key) != wanted[key]]
    if other:
        key = other[0]
        raise InputError(
            tr("The run in this folder was started with {what} {a}, but now it is {b}").format(
                what=key, a=_shown(begun.get(key)), b=_shown(wanted[key])
            ),
            where=str(out),
            advice=tr("Use the same settings as at the start, or choose a new folder"),
        )


def _read(path: Path) -> dict[str, Any]:
    try:
        content = parse_json(read_file(path))
    except OSError as error:
        raise unreadable(error, path) from error
    except ValueError as error:
        raise _damaged(path) from error
    if not isinstance(content, dict):
        raise _damaged(path)
    return content


def _damaged(path: Path) -> InputError:
    return InputError(
        tr("The file is damaged"),
        where=str(path),
        advice=tr("Restore it, or choose a new folder"),
    )


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return ",".join(map(str, value))
    return tr("nothing") if value is None else str(value)
