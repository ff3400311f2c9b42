"""Commands that write a calibration, or what is needed for one."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from gelpolight_core.base.atomic_write import write_atomically, write_json
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.number import read_number
from gelpolight_core.base.user_name import user_name
from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
from gelpolight_core.calibration.closed_sensor.imported_folders import FORMS, read_foreign
from gelpolight_core.calibration.closed_sensor.preset import preset_named, presets
from gelpolight_core.calibration.closed_sensor.session_import import ImportOptions, import_session
from gelpolight_core.calibration.closed_sensor_recipe import recipe_with_prior
from gelpolight_core.calibration.closed_sensor_stages import with_background
from gelpolight_core.calibration.project import CalibrationRun, run_calibration
from gelpolight_core.calibration.recipes import recipe_named, recipe_of, session_to_calibrate
from gelpolight_core.output.normal_table import write_normal_table
from gelpolight_core.reconstruction.background_shift import background_shift, with_zero
from gelpolight_core.sensor.closed_sensor.closed_sensor_data import ClosedSensor
from gelpolight_core.session.session import read_session
from gelpolight_core.session.session_images import average, read_colours

from .common import quality_lines, stage_progress, tolerances
from .options import Command, option, output, positional, result_option
from .reconstructing import load_reconstructor, model, read_frame, report_failure
from .terminal import print_safe


@dataclass(frozen=True)
class CalibrateCommand(Command):
    """A session folder becomes a calibration file."""

    session: Path = positional("SESSION")
    output: Path = output("CALIBRATION")
    json: Path | None = result_option("write the results of every stage as JSON")
    model: str | None = model()

    def run(self) -> None:
        """Calibrate, write the file and print the quality table."""
        session = session_to_calibrate(self.session)
        recipe = recipe_of(session, self.model)
        with stage_progress() as progress:
            run = run_calibration(
                session, recipe, progress=progress, tolerance_percent=tolerances(None)[1]
            )
        write_calibration(run.calibration, self.output)
        if self.json:
            write_json(self.json, run_as_json(run))
        stages = recipe.of(session)
        lines = [line for stage in stages for line in stage.lines(run.results[stage])]
        print_safe("\n".join([*lines, *quality_lines(run.calibration.quality)]))
        report_failure(run.calibration, self.output)
        print_safe(
            f"Calibration {run.calibration.identity} saved to "
            f"{self.output}: {run.calibration.verdict.value}"
        )


def run_as_json(run: CalibrationRun) -> dict[str, Any]:
    """Return the results of every stage as plain values, lengths in mm, sensor frame."""
    c = run.calibration
    content = {"id": c.identity, "model": c.model, "verdict": c.verdict.value}
    for stage in recipe_named(c.model).of(run.session):
        content |= stage.entries(run.results)
    return {**content, "quality": {stage: table.as_rows() for stage, table in c.quality.items()}}


@dataclass(frozen=True)
class RefreshCommand(Command):
    """A closed sensor's calibration after its gel was changed."""

    calibration: Path = positional("CALIBRATION")
    output: Path = output("CALIBRATION")
    background: list[Path] | None = option(
        "images of the new gel, untouched; slopes stay as calibrated", one_of=True, metavar="IMAGE"
    )
    session: Path | None = option(
        "background and ball presses of the new gel, which correct them",
        one_of=True,
        metavar="SESSION",
    )

    def run(self) -> None:
        """Write the refreshed calibration and print its quality."""
        calibration = read_calibration(self.calibration)
        earlier = calibration.data_of(ClosedSensor).in_place
        if self.background:
            images = [read_colours(file, response=calibration.response) for file in self.background]
            image, author = average(images, name=str(self.background[0])), user_name()
            refreshed = with_background(calibration, image, operator=author, made=_now())
        else:
            assert self.session is not None  # one of them is required
            session = read_session(self.session)
            recipe = recipe_with_prior(earlier)
            if not recipe.fits(session):
                raise InputError(
                    "the session is of an open sensor: session.toml has no table [in_place]",
                    self.session,
                    Remedy.CHOOSE_SESSION,
                )
            refreshed = run_calibration(
                session, recipe, tolerance_percent=tolerances(None)[1]
            ).calibration
        write_calibration(refreshed, self.output)
        print_safe("\n".join(quality_lines(refreshed.quality)))
        print_safe(
            f"Calibration {refreshed.identity} written to {self.output}: {refreshed.verdict.value}"
        )


@dataclass(frozen=True)
class DriftCommand(Command):
    """Change of the background of an untouched sensor since the calibration."""

    calibration: Path = positional("CALIBRATION")
    image: Path = positional("IMAGE")
    json: Path | None = result_option()
    zero: Path | None = result_option("write the calibration with this image as its new background")

    def run(self) -> None:
        """Compare, print the figures, and write the calibration with the new background."""
        reconstructor = load_reconstructor(self.calibration)
        frame = read_frame(self.image, reconstructor)
        shift = background_shift(frame, reconstructor.calibration)
        print_safe("\n".join(quality_lines({"background": shift.quality})))
        if self.json:
            content = {
                "touched": shift.touched,
                "shift_px": None if shift.shift_px is None else list(shift.shift_px),
                "brightness_percent": list(shift.brightness_percent),
                "differs_percent": shift.differs_percent,
                "verdict": shift.quality.verdict.value,
                "figures": shift.quality.as_rows(),
            }
            write_json(self.json, content)
        if self.zero:
            changed = with_zero(
                reconstructor.calibration, [frame], operator=user_name(), made=_now()
            )
            write_calibration(changed, self.zero)
            print_safe(f"{changed.identity} saved to {self.zero}")


@dataclass(frozen=True)
class ExportNormalsCommand(Command):
    """A closed sensor's calibration as a table for programs that look normals up by colour."""

    calibration: Path = positional("CALIBRATION")
    output: Path = output("TABLE", "the table, .npz: normals by change of colour and place")

    def run(self) -> None:
        """Write the table."""
        model = read_calibration(self.calibration).data_of(ClosedSensor).in_place
        write_atomically(self.output, partial(write_normal_table, model))
        print_safe(f"Normals by colour and place saved to {self.output}")


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _length(text: str) -> float:
    """Return a length in mm."""
    value = read_number(text, "MM")
    if not 1e-4 <= value <= 1000.0:
        raise argparse.ArgumentTypeError(f"{text} is not a possible length")
    return value


@dataclass(frozen=True)
class ImportCommand(Command):
    """A calibration folder of another library becomes a closed sensor's session."""

    folder: Path = positional("FOLDER", f"with one of: {FORMS}")
    output: Path = output("SESSION", writes=False)
    preset: str | None = option(
        f"kind of sensor, for its scale: {', '.join(sorted(presets()))}, or a TOML file",
        metavar="NAME",
    )
    mm_per_px: float | None = option("size of a pixel", type=_length, metavar="MM")
    ball_diameter: float | None = option(
        "where the folder does not state it", type=_length, metavar="MM"
    )
    background: Path | None = option("the untouched membrane", metavar="IMAGE")
    serial: str | None = option("name of the sensor", metavar="NAME")

    def run(self) -> None:
        """Write the session."""
        foreign = read_foreign(self.folder)
        declared = ImportOptions(
            self.serial or self.folder.resolve().name,
            self.mm_per_px,
            None if self.ball_diameter is None else 0.5 * self.ball_diameter,
            self.background,
            preset_named(self.preset) if self.preset else None,
        )
        session = import_session(foreign, declared, self.output)
        print_safe(
            f"{len(foreign.presses)} presses from {foreign.form} saved to {self.output}; "
            f"{len(session.decisions.balls)} with a labelled circle"
        )
        if declared.preset is not None and declared.preset.limits:
            print_safe(declared.preset.limits)
