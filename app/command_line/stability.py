"""``gelpolight stability``: stiff and extreme cases, each right or refused."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

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
    result_line,
    sensitivity_table,
    summary_line,
    write_stability,
)
from gelpolight_core.experiments.stability_trial import standard_sensor
from gelpolight_core.export.atomic import make_folder, refuse_unwritable
from gelpolight_core.translation import tr

SENSITIVITY = "sensitivity"
CASES_SHARE = 0.75


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser("stability", help=tr("run stiff and extreme cases"))
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT")
    parser.add_argument(
        "--only",
        metavar="NAMES",
        help=tr("only these cases or subjects, separated by commas: {names}").format(
            names=", ".join([*dict.fromkeys(c.subject for c in all_cases()), SENSITIVITY])
        ),
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the cases, print a line for each, and write the report."""
    names = options.only
    asked = [] if names is None else [name.strip() for name in names.split(",")]
    others = ",".join(name for name in asked if name != SENSITIVITY)
    cases = () if asked == [SENSITIVITY] else chosen_cases(all_cases(), others or None)
    wants_sensitivity = names is None or SENSITIVITY in asked
    make_folder(options.output)
    refuse_unwritable(options.output / "stability.html")
    found: tuple[Sensitivity, ...] = ()
    with StageProgress() as tell:
        results = run_cases(
            cases,
            progress=lambda name, share: tell(name, CASES_SHARE * share),
            done=_print_line,
        )
        if wants_sensitivity:
            found = sensitivities(
                standard_sensor(),
                progress=lambda name, share: tell(name, CASES_SHARE + (1 - CASES_SHARE) * share),
            )
    if found:
        say("\n" + sensitivity_table(found))
    say("\n" + summary_line(results))
    written = write_stability(results, found, options.output)
    say(tr("Written: {files}").format(files=", ".join(str(path) for path in written)))
    return 1 if any(result.outcome is Outcome.FAILED for result in results) else 0


def _print_line(result: CaseResult) -> None:
    with tqdm.external_write_mode():
        say(result_line(result), flush=True)
