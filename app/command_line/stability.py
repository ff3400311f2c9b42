"""``gelpolight stability``: stiff and extreme cases. Each must be solved correctly or refused."""

from __future__ import annotations

import argparse
from pathlib import Path

from tqdm import tqdm

from app.command_line.common import stage_progress
from app.command_line.terminal import say
from gelpolight_core.io.atomic import make_folder, refuse_unwritable
from gelpolight_core.studies.stability import (
    Outcome,
    chosen_cases,
    run_case,
    summary_line,
    write_stability,
)
from gelpolight_core.studies.stability_cases import all_cases
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command and its function."""
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT")
    parser.add_argument(
        "--only",
        metavar="NAMES",
        help=tr("only these cases or subjects, separated by commas: {names}").format(
            names=", ".join(dict.fromkeys(case.subject for case in all_cases()))
        ),
    )


def run(options: argparse.Namespace) -> int:
    """Run the cases, print a line for each, and write table and figure."""
    cases = chosen_cases(all_cases(), options.only)
    make_folder(options.output)
    refuse_unwritable(options.output / "stability.csv")
    results = []
    with stage_progress() as progress:
        for number, case in enumerate(cases):
            progress(case.name, number / len(cases))
            results.append(run_case(case))
            with tqdm.external_write_mode():
                say(results[-1].line, flush=True)
        progress("", 1.0)
    say("\n" + summary_line(results))
    written = write_stability(results, options.output)
    say(tr("Saved: {files}").format(files=", ".join(str(path) for path in written)))
    return 1 if any(result.outcome is Outcome.FAILED for result in results) else 0
