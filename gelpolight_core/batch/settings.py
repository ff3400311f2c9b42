"""The settings of a run, stored in its folder; they must not change there."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from gelpolight_core import __version__
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.atomic import write_json
from gelpolight_core.io.reading import parse_json, read_file

FILE = "batch.json"


@dataclass(frozen=True, slots=True)
class BatchSettings:
    """Settings for every frame of a run.

    Attributes
    ----------
    calibration : Path
        Its file, as every worker finds it; it may move if its identity stays.
    calibration_id : str
        Identity of the calibration.
    model, effort : str
        As for :class:`~gelpolight_core.reconstruction.reconstructor.Reconstructor`.
    formats : tuple of str
        Out of :data:`~gelpolight_core.export.heightmap_files.FORMATS`.
    measure : str or None
        The shape measured in every frame; None for no measurement.
    program : str
        Version of the program.
    """

    calibration: Path
    calibration_id: str
    model: str
    effort: str
    formats: tuple[str, ...]
    measure: str | None = None
    program: str = __version__

    def as_json(self) -> dict[str, Any]:
        """Return the settings that affect the results as plain values."""
        plain = asdict(self) | {"formats": ",".join(self.formats)}
        del plain["calibration"]
        return {"format": "gelpolight-batch", "version": 1, **plain}


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
    write_json(out / FILE, settings.as_json())


def require_same(settings: BatchSettings, out: Path) -> None:
    """Refuse settings that differ from those of the run in a folder.

    Raises
    ------
    InputError
        If the folder contains no run, its file is damaged, or a setting differs.
    """
    try:
        begun = dict(parse_json(read_file(out / FILE)))
    except (FileNotFoundError, ValueError, TypeError) as error:
        raise InputError(
            "The settings of the run are missing or damaged", out / FILE, Remedy.CLUSTER
        ) from error
    for key, value in settings.as_json().items():
        if begun.get(key) != value:
            raise InputError(
                (
                    f"The run in this folder was started with {key} "
                    f"{begun.get(key)}, but now it is {value}"
                ),
                out,
                Remedy.START_NEW,
            )
