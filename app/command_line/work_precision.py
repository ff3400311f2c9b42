"""``gelpolight work-precision``: error against run time of every method."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from app.command_line.common import StageProgress
from app.command_line.terminal import say
from gelpolight_core.calibration.file import read_open_calibration
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.errors import InputError
from gelpolight_core.experiments.front.measure import REPEATS, Point
from gelpolight_core.experiments.front.methods import Method, methods
from gelpolight_core.experiments.front.quiet import Watch
from gelpolight_core.experiments.front.report import (
    order_table,
    point_table,
    write_work_precision,
)
from gelpolight_core.experiments.front.run import (
    WIDTHS,
    Source,
    measure_leaving_out,
    measure_sensor,
    sources,
)
from gelpolight_core.experiments.front.trial import measure_calibration, measure_virtual
from gelpolight_core.experiments.integrators.measure import IntegratorPoint, measure_integrators
from gelpolight_core.experiments.leave_out import RuleFigure, rule_table
from gelpolight_core.io.atomic import make_folder, refuse_unwritable
from gelpolight_core.session.session import read_session
from gelpolight_core.translation import tr

LEAST_WIDTH, MOST_WIDTH = 160, 5120
MOST_WAIT_S = 300.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command and its function."""
    parser.add_argument(
        "sessions",
        type=Path,
        nargs="*",
        metavar="SESSION",
        help=tr("folders with presses and their true values, in addition to two virtual sensors"),
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT")
    parser.add_argument(
        "--calibration",
        type=Path,
        metavar="FILE",
        help=tr("measure with this calibration; without SESSION, on simulated presses"),
    )
    parser.add_argument(
        "--widths",
        default=",".join(str(w) for w in WIDTHS),
        metavar="N,...",
        help=tr(
            "image widths in pixels; those that a sensor's images do not allow are left out"
            " (default: %(default)s)"
        ),
    )
    parser.add_argument(
        "--methods",
        metavar="NAMES",
        help=tr("only these methods, separated by commas: {names}").format(
            names=", ".join(method.name for method in methods())
        ),
    )
    parser.add_argument("--repeats", type=int, default=REPEATS, metavar="N")
    parser.add_argument("--seed", type=int, default=0, metavar="N")
    parser.add_argument(
        "--no-virtual", action="store_true", help=tr("only the given sessions, no virtual sensor")
    )
    parser.add_argument(
        "--wait",
        type=float,
        default=MOST_WAIT_S,
        metavar="SECONDS",
        help=tr("longest time to wait for a quiet machine (default: %(default)g)"),
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Measure all methods on all sensors, print the tables and write the report."""
    chosen, widths = _chosen(options.methods, options.seed), _widths(options.widths)
    repeats = max(options.repeats, 1)
    if options.calibration is not None:
        for folder in options.sessions:  # before the long work
            read_session(folder)
        calibration = read_open_calibration(options.calibration)

        def work(progress: Callable[[str, float], None]) -> list[Point]:
            common = {"repeats": repeats, "progress": progress}
            if not options.sessions:
                return [*measure_virtual(calibration, SensorDesign(), chosen, **common)]
            found = [
                measure_calibration(calibration, f, chosen, **common) for f in options.sessions
            ]
            return [point for points in found for point in points]

        return _measured(options, work, [], integration=False)
    found = sources(options.sessions, options.output, virtual=not options.no_virtual)
    _refuse_none(found)

    rules: list[RuleFigure] = []

    def work_all(progress: Callable[[str, float], None]) -> list[Point]:
        points: list[Point] = []
        for number, source in enumerate(found):
            within = partial(_share_of, progress, number, len(found))
            points += measure_sensor(
                source, chosen, widths=widths, repeats=repeats, seed=options.seed, progress=within
            )
            rules.extend(measure_leaving_out(source, seed=options.seed, progress=within))
        return points

    return _measured(options, work_all, rules, integration=True)


def _measured(
    options: argparse.Namespace,
    work: Callable[[Callable[[str, float], None]], list[Point]],
    rules: list[RuleFigure],
    *,
    integration: bool,
) -> int:
    """Wait for a quiet machine, measure, print and write."""
    make_folder(options.output)
    refuse_unwritable(options.output / "work-precision.html")
    integrators: Sequence[IntegratorPoint] = ()
    with StageProgress() as progress:
        watch = Watch(max(options.wait, 0.0), progress)
        points = work(progress)
        if integration:
            integrators = measure_integrators(progress=progress)
        machine = watch.result()
    say(point_table(points), end="\n\n")
    if integration:
        say(order_table(points), end="\n\n")
        say(rule_table(rules), end="\n\n")
    written = write_work_precision(
        points, integrators, options.output, rules=rules, machine=machine
    )
    say(machine.text)
    say(tr("Saved: {files}").format(files=", ".join(str(path) for path in written)))
    return 0


def _share_of(
    progress: Callable[[str, float], None], number: int, total: int, what: str, share: float
) -> None:
    progress(what, (number + share) / total)


def _refuse_none(found: Sequence[Source]) -> None:
    if not found:
        raise InputError(
            tr("There is no sensor to measure"),
            where="--no-virtual",
            advice=tr("Give session folders, or leave out this option"),
        )


def _chosen(names: str | None, seed: int) -> Sequence[Method]:
    known = {method.name: method for method in methods(seed=seed)}
    if names is None:
        return tuple(known.values())
    asked = [name.strip() for name in names.split(",")]
    for name in asked:
        if name not in known:
            raise InputError(
                tr("The method {name!r} does not exist").format(name=name),
                where="--methods",
                advice=tr("Choose from {names}").format(names=", ".join(known)),
            )
    return tuple(known[name] for name in asked)


def _widths(text: str) -> list[int]:
    try:
        widths = [int(part) for part in text.split(",") if part.strip()]
    except ValueError:
        widths = []
    if not widths or not all(LEAST_WIDTH <= width <= MOST_WIDTH for width in widths):
        raise InputError(
            tr("The widths {text!r} are not valid").format(text=text),
            where="--widths",
            advice=tr("Give whole numbers from {low} to {high}, separated by commas").format(
                low=LEAST_WIDTH, high=MOST_WIDTH
            ),
        )
    return widths
