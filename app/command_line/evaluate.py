"""``gelpolight evaluate``: the paper's evaluation on a folder of presses with their truth."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from app.command_line.common import StageProgress, add_model, load_reconstructor
from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import make_folder
from gelpolight_core.measurement.evaluation import evaluate_presses
from gelpolight_core.measurement.evaluation_report import evaluation_table, write_evaluation
from gelpolight_core.measurement.truth import read_truth
from gelpolight_core.reconstruction.heightmap import HeightMap
from gelpolight_core.session.session import read_picture, require_colour
from gelpolight_core.translation import tr


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser("evaluate", help=tr("compare measured presses with their truth"))
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.add_argument("presses", type=Path, metavar="PRESSES")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT")
    add_model(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Measure every press, write the report's files and print the table."""
    reconstructor = load_reconstructor(options.calibration, model=options.model)
    read_truth(options.presses)  # before a folder is made for nothing
    make_folder(options.output)

    def reconstruct(path: Path) -> HeightMap:
        picture = read_picture(path, response=reconstructor.calibration.response)
        require_colour(picture, where=str(path))
        return reconstructor.depth(picture.rgb, name=path.name, normals=False)

    with StageProgress() as tell:
        evaluation = evaluate_presses(options.presses, reconstruct, progress=tell)
    written = write_evaluation(evaluation, options.output)
    print(evaluation_table(evaluation))
    print(tr("Written: {files}").format(files=", ".join(str(path) for path in written)))
    if len(evaluation.failed) == len(evaluation.results):
        raise InputError(
            tr("none of the {n} presses could be measured ({reason})").format(
                n=len(evaluation.results), reason=evaluation.failed[0].failure.rstrip(".")
            ),
            where=str(options.presses),
            advice=tr("Check that the calibration is this sensor's"),
        )
    return 0
