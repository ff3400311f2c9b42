"""``gelpolight protocol``: the paper's evaluation protocol, run by the virtual bench."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path

from app.command_line.common import StageProgress, add_workers
from app.command_line.evaluate import report
from app.command_line.reconstructing import add_model, load_reconstructor
from gelpolight_core.design.sensor_design import SensorDesign, read_design
from gelpolight_core.errors import InputError
from gelpolight_core.experiments.press_workers import Equipment
from gelpolight_core.experiments.virtual_protocol import (
    calibrate_virtual_sensor,
    evaluate_run,
    press_protocol,
    run_ledger,
)
from gelpolight_core.io.atomic import make_folder
from gelpolight_core.io.lock import RunLock
from gelpolight_core.measurement.protocol import (
    SHAPES,
    Protocol,
    check_protocol,
    protocol_reach_mm,
)
from gelpolight_core.measurement.protocol_file import FILE_NAME
from gelpolight_core.measurement.protocol_run import ProtocolRun, begin_run, open_run
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.translation import tr

REPORT = "report"
FAR_MM = 200.0
"""The available area is only known after the calibration."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command and its function."""
    parser.add_argument(
        "output",
        type=Path,
        metavar="OUT",
        help=tr("folder of the run; an unfinished run is continued"),
    )
    parser.add_argument("--design", type=Path, metavar="FILE", help=tr("sensor design (TOML)"))
    parser.add_argument(
        "--calibration",
        type=Path,
        metavar="FILE",
        help=tr("calibration of that sensor; by default, the virtual sensor is calibrated first"),
    )
    paper = Protocol()
    parser.add_argument("--shapes", nargs="+", choices=SHAPES, default=list(paper.shapes))
    parser.add_argument(
        "--sizes",
        nargs="*",
        type=float,
        default=list(paper.sizes_mm),
        metavar="MM",
        help=tr("sizes in mm, at a height of 1 mm"),
    )
    parser.add_argument(
        "--heights",
        nargs="*",
        type=float,
        default=list(paper.heights_mm),
        metavar="MM",
        help=tr("heights in mm, at a size of 5 mm"),
    )
    parser.add_argument("--repeats", type=int, default=paper.repeats, metavar="N")
    parser.add_argument("--regions", type=int, default=paper.regions, metavar="N")
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help=tr("seed of the random positions")
    )
    add_model(parser)
    add_workers(parser, default=2)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Calibrate if necessary, press, measure, and write the report."""
    design = read_design(options.design) if options.design else SensorDesign()
    wanted = _wanted(options)
    make_folder(options.output)
    with RunLock(options.output), StageProgress() as progress:
        calibration = options.calibration or calibrate_virtual_sensor(
            design, options.output, progress=progress
        )
        reconstructor = load_reconstructor(calibration, model=options.model)
        protocol_run = _begin_or_go_on(options.output, wanted, reconstructor)
        ledger = run_ledger(protocol_run, reconstructor)
        equipment = Equipment(calibration, options.model, design)
        press_protocol(protocol_run, equipment, ledger, workers=options.workers, progress=progress)
        evaluation = evaluate_run(protocol_run, reconstructor, ledger)
    folder = options.output / REPORT
    make_folder(folder)
    report(evaluation, reconstructor.calibration, folder, protocol_run.presses)
    return 0


def _wanted(options: argparse.Namespace) -> Protocol:
    if options.seed < 0:
        raise InputError(
            tr("The seed is {seed}").format(seed=options.seed),
            where="--seed",
            advice=tr("Give a whole number of at least 0"),
        )
    return check_protocol(
        Protocol(
            shapes=tuple(options.shapes),
            sizes_mm=tuple(options.sizes),
            heights_mm=tuple(options.heights),
            repeats=options.repeats,
            regions=options.regions,
            reach_mm=FAR_MM,
            seed=options.seed,
        ),
        where=tr("arguments"),
    )


def _begin_or_go_on(folder: Path, wanted: Protocol, reconstructor: Reconstructor) -> ProtocolRun:
    calibration = reconstructor.calibration
    # Rounded to hundredths, like the written values.
    reach_mm = math.floor(100.0 * protocol_reach_mm(calibration)) / 100.0
    within = replace(wanted, reach_mm=reach_mm)
    if not (folder / FILE_NAME).is_file():
        return begin_run(
            folder,
            within,
            serial=calibration.sensor.serial,
            calibration=calibration.identity,
        )
    begun = open_run(folder)
    if begun.protocol != within or begun.content.calibration != calibration.identity:
        raise InputError(
            tr("The folder contains a run of another protocol or calibration"),
            where=str(folder / FILE_NAME),
            advice=tr(
                "Give the same arguments as at the start of that run, or choose a new folder"
            ),
        )
    return begun
