"""``gelpolight stability``: stiff and extreme cases. Each must be solved correctly or refused."""

from __future__ import annotations

import argparse
from pathlib import Path

from tqdm import tqdm

from app.command_line.common import StageProgress
from app.command_line.terminal import say
from gelpolight_core.experiments.sensitivity import Sensitivity, sensitivities
from gelpolight_core.experiments.stability import (
    CaseResult,
    Outcome,
    chosen_cases,
    run_cases,
)
from gelpolight_core.experiments.stability_cases import all_cases
from gelpolight_core.experiments.stability_report import (
    length_table,
    result_line,
    sensitivity_table,
    summary_line,
    write_stability,
)
from gelpolight_core.experiments.stability_sessions import LengthCost, length_costs
from gelpolight_core.experiments.stability_trial import standard_sensor
from gelpolight_core.io.atomic import make_folder, refuse_unwritable
from gelpolight_core.translation import tr

SENSITIVITY, LENGTHS = "sensitivity", "lengths"
CASES_SHARE, SENSITIVITY_END = 0.8, 0.9


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command and its function."""
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT")
    parser.add_argument(
        "--only",
        metavar="NAMES",
        help=tr("only these cases or subjects, separated by commas: {names}").format(
            names=", ".join([*dict.fromkeys(c.subject for c in all_cases()), SENSITIVITY, LENGTHS])
        ),
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the cases, print a line for each, and write the report."""
    names = options.only
    asked = [] if names is None else [name.strip() for name in names.split(",")]
    others = ",".join(name for name in asked if name not in (SENSITIVITY, LENGTHS))
    cases = () if asked and not others else chosen_cases(all_cases(), others or None)
    wants_sensitivity = names is None or SENSITIVITY in asked
    wants_lengths = names is None or LENGTHS in asked
    make_folder(options.output)
    refuse_unwritable(options.output / "stability.html")
    found: tuple[Sensitivity, ...] = ()
    costs: tuple[LengthCost, ...] = ()
    with StageProgress() as progress:
        results = run_cases(
            cases,
            progress=lambda name, share: progress(name, CASES_SHARE * share),
            done=_print_line,
        )
        if wants_sensitivity:
            found = sensitivities(
                standard_sensor(),
                progress=lambda name, share: progress(
                    name, CASES_SHARE + (SENSITIVITY_END - CASES_SHARE) * share
                ),
            )
        if wants_lengths:
            costs = length_costs(
                progress=lambda name, share: progress(
                    name, SENSITIVITY_END + (1 - SENSITIVITY_END) * share
                )
            )
    if found:
        say("\n" + sensitivity_table(found))
    if costs:
        say("\n" + length_table(costs))
    say("\n" + summary_line(results))
    written = write_stability(results, found, costs, options.output)
    say(tr("Saved: {files}").format(files=", ".join(str(path) for path in written)))
    return 1 if any(result.outcome is Outcome.FAILED for result in results) else 0


def _print_line(result: CaseResult) -> None:
    with tqdm.external_write_mode():
        say(result_line(result), flush=True)
