"""``gelpolight calibrate``: turns a session folder into a calibration file."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from app.command_line.common import check_outputs, quality_lines, stage_progress
from app.command_line.reconstructing import add_model, report_failure
from app.command_line.sessions import session_files
from app.command_line.terminal import say
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.calibration.missing import session_to_calibrate
from gelpolight_core.calibration.project import Run, calibrate
from gelpolight_core.calibration.recipes import recipe_named, recipe_of
from gelpolight_core.io.atomic import write_json
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("session", type=Path, metavar="SESSION")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="CALIBRATION")
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help=tr("write the results of every stage as JSON")
    )
    add_model(parser)


def run(options: argparse.Namespace) -> int:
    """Calibrate, write the file and print the quality table."""
    session = session_to_calibrate(options.session)
    recipe = recipe_of(session, options.model)
    check_outputs([options.output, options.json], session_files(session))
    with stage_progress() as progress:
        result = calibrate(session, recipe, progress=progress)
    write_calibration(result.calibration, options.output)
    if options.json:
        write_json(options.json, run_as_json(result))
    stages = recipe.of(session)
    lines = [line for stage in stages for line in stage.lines(result.results[stage])]
    say("\n".join([*lines, *quality_lines(result.calibration.quality)]))
    report_failure(result.calibration, options.output)
    say(
        tr("Calibration {id} saved to {path}: {verdict}").format(
            id=result.calibration.identity,
            path=options.output,
            verdict=result.calibration.verdict.value,
        )
    )
    return 0


def run_as_json(run: Run) -> dict[str, Any]:
    """Return the results of every stage as plain values, lengths in mm, sensor frame."""
    c = run.calibration
    content = {"id": c.identity, "model": c.model, "verdict": c.verdict.value}
    for stage in recipe_named(c.model).of(run.session):
        content |= stage.entries(run.results)
    return {**content, "quality": {stage: table.as_rows() for stage, table in c.quality.items()}}
