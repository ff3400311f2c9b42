"""What the results of a run depend on; it stands in the run's folder, and may not change there."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from gelpolight_core import __version__
from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import write_atomically
from gelpolight_core.reading import parse_json, read_file, unreadable
from gelpolight_core.translation import tr

FILE = "batch.json"
FORMAT = "gelpolight-batch"
VERSION = 1


@dataclass(frozen=True, slots=True)
class BatchSettings:
    """What every frame of a run is done with.

    Attributes
    ----------
    calibration : Path
        Its file, as every worker finds it; it may move while its identity stays.
    identity : str
        Of the calibration.
    model, effort : str
        As for :class:`~gelpolight_core.reconstruction.reconstructor.Reconstructor`.
    formats : tuple of str
        Out of :data:`~gelpolight_core.export.heightmap_files.FORMATS`.
    shape : str or None
        What is measured in every frame; None: nothing.
    program : str
        Version that does it.
    """

    calibration: Path
    identity: str
    model: str
    effort: str
    formats: tuple[str, ...]
    shape: str | None = None
    program: str = __version__

    def as_json(self) -> dict[str, Any]:
        """Return what the results depend on as plain values."""
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
    """Write the settings into a new run's folder, or compare them with those it was begun with.

    Raises
    ------
    InputError
        If the run in the folder was begun with other settings, or the file cannot be read or
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
    """Refuse settings that are not those of the run in a folder.

    Raises
    ------
    InputError
        If the folder holds no run, its file is damaged, or something in it is different.
    """
    begun = _read(out / FILE)
    wanted = settings.as_json()
    other = [key for key in wanted if begun.get(key) != wanted[key]]
    if other:
        key = other[0]
        raise InputError(
            tr("the run in this folder was begun with {what} {a}, and this is {b}").format(
                what=key, a=_shown(begun.get(key)), b=_shown(wanted[key])
            ),
            where=str(out),
            advice=tr("Give the same as at its beginning, or name a new folder"),
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
        tr("the file is damaged"),
        where=str(path),
        advice=tr("Put it back as it was written, or name a new folder"),
    )


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return ",".join(map(str, value))
    return tr("nothing") if value is None else str(value)
