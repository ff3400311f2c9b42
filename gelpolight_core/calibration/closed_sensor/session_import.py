"""Turn a calibration folder of another library into the session of a closed sensor."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

from gelpolight_core.base.atomic_write import make_folder, write_atomically
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.safe_reading import read_file
from gelpolight_core.image.image_file import FILE_LIMIT
from gelpolight_core.session.decisions import Decisions, write_decisions
from gelpolight_core.session.description import create_session
from gelpolight_core.session.session import ClosedSensorSettings, SensorData, Session
from gelpolight_core.session.session_images import read_raw_image

from .imported_folders import ImportedCalibration, ImportedPress
from .preset import Preset


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """Values stated by the user about a folder, which precede those in the folder.

    Attributes
    ----------
    serial : str
        Serial number of the sensor.
    mm_per_px : float or None
        The scale.
    ball_radius_mm : float or None
        Radius of all balls.
    background : Path or None
        Image of the untouched membrane.
    preset : Preset or None
        For the scale, where nobody states it.
    """

    serial: str
    mm_per_px: float | None = None
    ball_radius_mm: float | None = None
    background: Path | None = None
    preset: Preset | None = None


def import_session(found: ImportedCalibration, stated: ImportOptions, out: Path) -> Session:
    """Write the session folder of a closed sensor.

    Labelled circles become circles drawn by hand (``decisions.toml``).

    Parameters
    ----------
    found : ImportedCalibration
        Presses and what the folder states.
    stated : ImportOptions
        What the user states.
    out : Path
        Folder to create; it must not exist, or be empty.

    Raises
    ------
    InputError
        If background, ball radius or scale is not known, or an image cannot be read or written.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError("The folder already contains files", out, Remedy.CHOOSE_FOLDER)
    background = stated.background or found.background
    if background is None:
        text = "The folder has no image of the untouched membrane"
        raise InputError(text, found.form, Remedy.STATE_WITH.format(option="--background"))
    names = [f"ball_{index:03d}" for index in range(len(found.presses))]
    pairs = list(zip(names, found.presses, strict=True))
    files = {name: name + press.image.suffix.lower() for name, press in pairs}
    scale, scale_sd = _scale(found, stated, background)
    session = Session(
        out,
        SensorData(stated.serial),
        in_place=ClosedSensorSettings((scale, scale), scale_sd),
        ball_radii_mm={files[name]: _radius(press, stated) for name, press in pairs},
        decisions=Decisions(
            balls={files[name]: press.circle for name, press in pairs if press.circle is not None}
        ),
    )
    is_new = not out.exists()
    try:
        create_session(session)
        _copy(background, out / "background" / f"background{background.suffix.lower()}")
        for name, press in pairs:
            _copy(press.image, out / "balls" / files[name])
        write_decisions(session.decisions, out)
    except BaseException:
        # An incomplete session is useless, and would block the next attempt.
        shutil.rmtree(out, ignore_errors=True)
        if not is_new:
            out.mkdir(exist_ok=True)
        raise
    return session


def _radius(press: ImportedPress, stated: ImportOptions) -> float:
    radius = stated.ball_radius_mm or press.radius_mm
    if radius is None:
        text, advice = "The folder does not state the diameter of the ball in mm", Remedy.STATE_WITH
        raise InputError(text, press.image.parent, advice.format(option="--ball-diameter"))
    return radius


def _scale(
    found: ImportedCalibration, stated: ImportOptions, background: Path
) -> tuple[float, float | None]:
    """Return the scale with its standard deviation where it is known."""
    if stated.mm_per_px is not None:
        return stated.mm_per_px, None
    if found.mm_per_px is not None:
        return found.mm_per_px, None
    if stated.preset is not None:
        rows, columns = read_raw_image(background).rgb.shape[:2]
        return stated.preset.scale_for(columns, rows)
    text = "The folder does not state the scale, and no preset is chosen"
    raise InputError(text, found.form, Remedy.STATE_WITH.format(option="--mm-per-px"))


def _copy(source: Path, target: Path) -> None:
    """Copy an image of a format that a session can contain."""
    read_raw_image(source)
    data = read_file(source, FILE_LIMIT)
    make_folder(target.parent)
    write_atomically(target, lambda stream: stream.write(data))
