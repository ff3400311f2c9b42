"""The presses of a session with their true depth, for the scripts beside this file."""

import csv
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gelpolight_core.calibration.project import run_stage
from gelpolight_core.calibration.recipe import StageContext, StageResults
from gelpolight_core.calibration.recipes import PAPER
from gelpolight_core.calibration.refinement_stage import refine, sensor_data
from gelpolight_core.lab.depth_score import TrueDepth, read_true_depth
from gelpolight_core.lab.reference_press import read_truth
from gelpolight_core.sensor.sensor_calibration import Calibration, Provenance
from gelpolight_core.session.session import Session
from gelpolight_core.session.session_images import read_raw_image


class TruePress(NamedTuple):
    """A press: file, height (mm), raw image (rows, columns, 3) and true depth."""

    file: str
    height_mm: float
    frame: np.ndarray
    truth: TrueDepth


def true_presses(session: Session, most: int | None = None) -> list[TruePress]:
    """Return the presses of ``presses/truth.csv`` with ``truth/*.npz``, or the first ones."""
    folder = session.folder
    return [
        TruePress(
            row.file,
            row.truth.height_mm,
            read_raw_image(folder / "presses" / row.file)[0],
            read_true_depth((folder / "truth" / row.file).with_suffix(".npz")),
        )
        for row in read_truth(folder / "presses").rows[:most]
    ]


def stage_results(session: Session) -> StageResults:
    """Return the results of the stages of the paper's model."""
    results = StageResults()
    for stage in PAPER.stages:
        print(stage.key, file=sys.stderr)
        results = run_stage(PAPER, stage, session, results)
    return results


def full_calibration(session: Session, results: StageResults) -> Calibration:
    """Return the calibration of these results after a joint refinement, without figures."""
    data = sensor_data(session, results, refine(StageContext(session, results, {})))
    return Calibration("full", data, {}, Provenance("", "", "", "", {}))


def show(rows: Iterable[Mapping[str, Any]]) -> None:
    """Print rows with the same keys as CSV, numbers with four digits."""
    rows = list(rows)
    writer = csv.DictWriter(sys.stdout, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        texts = {k: f"{v:.4g}" if isinstance(v, float) else v for k, v in row.items()}
        writer.writerow(texts)


def folder_named(number: int = 1) -> Path:
    """Return the folder or file that the command line names."""
    if len(sys.argv) <= number:
        raise SystemExit((sys.modules["__main__"].__doc__ or "").strip())
    return Path(sys.argv[number])
