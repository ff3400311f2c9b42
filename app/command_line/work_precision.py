"""``gelpolight work-precision``: error against run time of every method."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from app.command_line.common import StageProgress
from app.command_line.terminal import say
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.errors import InputError
from gelpolight_core.experiments.integrators import SIDES, IntegratorPoint, measure_integrators
from gelpolight_core.experiments.methods import Method, methods
from gelpolight_core.experiments.work_precision import (
    LEAST_REPEATS,
    Point,
    is_session,
    measure_session,
    session_folder_name,
)
from gelpolight_core.experiments.work_precision_report import (
    order_table,
    point_table,
    write_work_precision,
)
from gelpolight_core.experiments.work_precision_trial import (
    FLAT_TOPPED,
    measure_calibration,
    measure_virtual,
)
from gelpolight_core.export.atomic import make_folder, refuse_unwritable
from gelpolight_core.measurement.truth import read_truth
from gelpolight_core.session.session import read_session
from gelpolight_core.simulation.session import simulate_session
from gelpolight_core.translation import tr

SCALES = (0.25, 0.5, 1.0)
LEAST_SCALE, MOST_SCALE = 0.2, 4.0


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser("work-precision", help=tr("show error against run time"))
    parser.add_argument(
        "sessions",
        type=Path,
        nargs="*",
        metavar="SESSION",
        help=tr("folders with presses and their truth, beside the virtual sensor"),
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT")
    parser.add_argument(
        "--calibration",
        type=Path,
        metavar="FILE",
        help=tr("measure with this calibration as it is; without SESSION, on rendered presses"),
    )
    parser.add_argument(
        "--scales",
        default=",".join(f"{s:g}" for s in SCALES),
        metavar="S,...",
        help=tr("picture sizes of the virtual sensor, 1 for 1280x960 (default: %(default)s)"),
    )
    parser.add_argument(
        "--methods",
        metavar="NAMES",
        help=tr("only these, separated by commas: {names}").format(
            names=", ".join(method.name for method in methods())
        ),
    )
    parser.add_argument("--repeats", type=int, default=LEAST_REPEATS, metavar="N")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Measure all methods on all sensors, print the tables and write the report."""
    chosen, scales = _chosen(options.methods), _scales(options.scales)
    for folder in options.sessions:  # before the long work
        read_session(folder)
        read_truth(folder / "presses" / "truth.csv")
    make_folder(options.output)
    refuse_unwritable(options.output / "work-precision.html")
    repeats = max(options.repeats, 1)
    if options.calibration is not None:
        return _with_calibration(options, chosen, repeats)
    points: list[Point] = []
    with StageProgress() as tell:
        folders = [_virtual_session(options.output, scale, tell) for scale in scales]
        for folder in [*folders, *options.sessions]:
            session = read_session(folder)
            rows = read_truth(folder / "presses" / "truth.csv").rows
            flat = [row.file for row in rows if row.truth.shape in FLAT_TOPPED]
            points += measure_session(
                session,
                chosen,
                repeats=repeats,
                presses=flat,
                progress=partial(_tell_of, folder.name, tell),
            )
        tell(tr("integration"), 0.0)
        sides = SIDES if max(scales, default=0.0) >= 1.0 else SIDES[:-2]
        integrators = measure_integrators(sides=sides, repeats=repeats)
    say(point_table(points), end="\n\n")
    say(order_table(points, integrators), end="\n\n")
    return _write(points, integrators, options.output)


def _with_calibration(options: argparse.Namespace, chosen: Sequence[Method], repeats: int) -> int:
    """Do the same with one calibration that is there already, as the program's own view does."""
    calibration = read_calibration(options.calibration)
    points: list[Point] = []
    with StageProgress() as tell:
        for folder in options.sessions:
            points += measure_calibration(
                calibration, folder, chosen, repeats=repeats, progress=tell
            )
        if not options.sessions:
            points += measure_virtual(
                calibration, SensorDesign(), chosen, repeats=repeats, progress=tell
            )
    say(point_table(points), end="\n\n")
    return _write(points, (), options.output)


def _write(points: Sequence[Point], integrators: Sequence[IntegratorPoint], folder: Path) -> int:
    written = write_work_precision(points, integrators, folder)
    say(tr("Written: {files}").format(files=", ".join(str(path) for path in written)))
    return 0


def _tell_of(sensor: str, tell: Any, what: str, share: float) -> None:
    tell(f"{sensor}: {what}" if what else sensor, share)


def _chosen(names: str | None) -> Sequence[Method]:
    if names is None:
        return methods()
    known = {method.name: method for method in methods()}
    asked = [name.strip() for name in names.split(",")]
    for name in asked:
        if name not in known:
            raise InputError(
                tr("there is no method {name!r}").format(name=name),
                where="--methods",
                advice=tr("Use some of {names}").format(names=", ".join(known)),
            )
    return tuple(known[name] for name in asked)


def _scales(text: str) -> list[float]:
    try:
        scales = [float(part) for part in text.split(",") if part.strip()]
    except ValueError:
        scales = []
    if not scales or not all(LEAST_SCALE <= scale <= MOST_SCALE for scale in scales):
        raise InputError(
            tr("the scales are {text!r}").format(text=text),
            where="--scales",
            advice=tr("Give numbers from {low:g} to {high:g}, separated by commas").format(
                low=LEAST_SCALE, high=MOST_SCALE
            ),
        )
    return scales


def _virtual_session(out: Path, scale: float, tell: Any) -> Path:
    """Simulate the virtual sensor at a picture size, unless it was done for an earlier run."""
    folder = out / session_folder_name(scale)
    if not is_session(folder):
        design = SensorDesign()
        flat = tuple(p for p in design.presses if p.shape in FLAT_TOPPED)
        simulate_session(
            replace(design, presses=flat), folder, scale=scale, progress=partial(_simulated, tell)
        )
    return folder


def _simulated(tell: Any, what: str, share: float) -> None:
    tell(tr("simulating {what}").format(what=what), share)
