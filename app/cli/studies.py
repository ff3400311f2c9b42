"""``gelpolight evaluate``, ``work-precision`` and ``stability``: how well presses are measured."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from tqdm import tqdm

from gelpolight_core.base.atomic_write import make_folder, refuse_unwritable
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.calibration.calibration_file import read_calibration
from gelpolight_core.calibration.project import run_calibration
from gelpolight_core.lab.batch.worker_pool import process_pool
from gelpolight_core.lab.evaluation_report import evaluation_table, write_evaluation_files
from gelpolight_core.lab.evaluation_run import evaluate_presses, measure_with, press_measurement
from gelpolight_core.lab.press_folder import presses_folder
from gelpolight_core.session.session import read_session
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.studies.stability import (
    CaseOutcome,
    chosen_cases,
    run_case,
    summary_line,
    write_stability,
)
from gelpolight_core.studies.stability_cases import all_cases
from gelpolight_core.studies.work_precision import (
    REPEATS,
    measure_session,
    measure_virtual,
    point_table,
    write_work_precision,
)

from .common import stage_progress, tolerance, tolerances
from .options import Command, file_option, option, output, positional
from .reconstructing import load_reconstructor, model
from .terminal import print_safe


@dataclass(frozen=True)
class EvaluateCommand(Command):
    """The paper's evaluation on a folder of presses with true values."""

    calibration: Path = positional("CALIBRATION")
    presses: Path = positional("PRESSES", "folder of images with truth.csv, or of their session")
    output: Path = output("OUT", writes=False)
    model: str | None = model()
    tolerance: tuple[float, float] | None = tolerance()
    workers: int = option(
        "number of images processed at the same time, one process each",
        choices=range(1, 65),
        default=1,
        metavar="N",
    )

    def run(self) -> None:
        """Measure every press, write the report's files and print the table."""
        limits_percent = tolerances(self.tolerance)
        reconstructor = load_reconstructor(self.calibration, self.model)
        presses = presses_folder(self.presses)  # before a folder is created for nothing
        make_folder(self.output)
        with stage_progress() as progress:
            evaluated = partial(
                evaluate_presses, presses, progress=progress, reconstructor=reconstructor
            )
            if self.workers > 1:
                remote = partial(measure_with, self.calibration, self.model)
                with process_pool(self.workers) as pool:
                    evaluation = evaluated(measure=remote, submit=pool.submit)
            else:
                evaluation = evaluated(measure=press_measurement(reconstructor))
        evaluation = replace(evaluation, limits_percent=limits_percent)
        written = write_evaluation_files(
            evaluation, self.output, calibration=reconstructor.calibration
        )
        print_safe(evaluation_table(evaluation))
        _say_saved(written)
        if len(evaluation.failed) == len(evaluation.results):
            reason = str(evaluation.failed[0].outcome).rstrip(".")
            raise InputError(
                f"None of the {len(evaluation.results)} presses could be measured ({reason})",
                presses,
                Remedy.SAME_SENSOR,
            )


@dataclass(frozen=True)
class WorkPrecisionCommand(Command):
    """Error against run time of every mode."""

    session: Path | None = positional(
        "SESSION", "folder with presses and their true depth (default: the virtual sensor)"
    )
    output: Path = output("OUT", writes=False)
    calibration: Path | None = file_option(
        "measure with this calibration (default: calibrate first)"
    )
    repeats: int = option(default=REPEATS, metavar="N")
    seed: int = option("seed of the virtual sensor and its presses", default=0, metavar="N")
    curves: bool = option("also change rounds, steps and tolerance of the best mode")

    def run(self) -> None:
        """Measure all modes, print the table, and write table and figure."""
        session = None if self.session is None else read_session(self.session)
        calibration = None if self.calibration is None else read_calibration(self.calibration)
        _make_folder_for(self.output / "work-precision.csv")
        options: dict[str, Any] = {"repeats": max(self.repeats, 1), "curves": self.curves}
        with stage_progress() as progress:
            if session is None:
                points = measure_virtual(
                    SensorDesign(), calibration, **options, seed=self.seed, progress=progress
                )
            else:
                if calibration is None:
                    calibration = run_calibration(session, progress=progress).calibration
                points = measure_session(session.folder, calibration, **options, progress=progress)
        print_safe(point_table(points), end="\n\n")
        _say_saved(write_work_precision(points, self.output))


@dataclass(frozen=True)
class StabilityCommand(Command):
    """Stiff and extreme cases. Each must be solved correctly or refused."""

    output: Path = output("OUT", writes=False)
    only: str | None = option(
        "only these cases or subjects, separated by commas: "
        + ", ".join(dict.fromkeys(case.subject for case in all_cases())),
        metavar="NAMES",
    )

    def run(self) -> int:
        """Run the cases, print a line for each, and write table and figure."""
        cases = chosen_cases(all_cases(), self.only)
        _make_folder_for(self.output / "stability.csv")
        results = []
        with stage_progress() as progress:
            for number, case in enumerate(cases):
                progress(case.name, number / len(cases))
                results.append(run_case(case))
                with tqdm.external_write_mode():
                    print_safe(results[-1].line, flush=True)
            progress("", 1.0)
        print_safe("\n" + summary_line(results))
        _say_saved(write_stability(results, self.output))
        return 1 if any(result.outcome is CaseOutcome.FAILED for result in results) else 0


def _make_folder_for(file: Path) -> None:
    """Create the folder of a file, before hours of work for nothing."""
    make_folder(file.parent)
    refuse_unwritable(file)


def _say_saved(files: Iterable[Path]) -> None:
    print_safe(f"Saved: {', '.join(map(str, files))}")
