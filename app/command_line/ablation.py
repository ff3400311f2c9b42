"""``gelpolight ablation``: the benefit and the cost of each term of the full model."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from app.command_line.common import StageProgress
from app.command_line.terminal import say
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.errors import InputError
from gelpolight_core.experiments.ablation import VARIANTS, Variant, ablate
from gelpolight_core.experiments.ablation_report import ablation_table, write_ablation
from gelpolight_core.io.atomic import make_folder, refuse_unwritable
from gelpolight_core.measurement.truth import read_truth
from gelpolight_core.session.session import read_session
from gelpolight_core.simulation.session import simulate_session
from gelpolight_core.translation import tr

VIRTUAL = "virtual-sensor"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command and its function."""
    parser.add_argument(
        "sessions",
        type=Path,
        nargs="*",
        metavar="SESSION",
        help=tr(
            "folders with presses and their true values (default: those of the virtual sensor)"
        ),
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT")
    parser.add_argument(
        "--terms",
        metavar="NAMES",
        help=tr("only these terms, separated by commas: {names}").format(
            names=", ".join(variant.name for variant in VARIANTS)
        ),
    )
    parser.add_argument("--repeats", type=int, default=1, metavar="N")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Leave out each term in turn, write the files and print a table for each session."""
    variants = _chosen(options.terms)
    for folder in options.sessions:  # before the long work
        read_session(folder)
        read_truth(folder / "presses" / "truth.csv")
    make_folder(options.output)
    refuse_unwritable(options.output / "ablation.csv")
    folders = options.sessions or [_virtual_session(options.output / VIRTUAL)]
    ablations = []
    for folder in folders:
        with StageProgress() as progress:
            ablation = ablate(
                read_session(folder),
                variants=variants,
                repeats=max(options.repeats, 1),
                progress=partial(_progress_of, folder.name, progress)
                if len(folders) > 1
                else progress,
            )
        ablations.append(ablation)
        say(ablation_table(ablation), end="\n\n", flush=True)
    written = write_ablation(ablations, options.output)
    say(tr("Saved: {files}").format(files=", ".join(str(path) for path in written)))
    return 0


def _progress_of(sensor: str, progress: Any, what: str, share: float) -> None:
    progress(f"{sensor}: {what}" if what else sensor, share)


def _chosen(names: str | None) -> tuple[Variant, ...]:
    if names is None:
        return VARIANTS
    known = {variant.name: variant for variant in VARIANTS}
    asked = [name.strip() for name in names.split(",")]
    for name in asked:
        if name not in known:
            raise InputError(
                tr("The term {name!r} does not exist").format(name=name),
                where="--terms",
                advice=tr("Choose from {names}").format(names=", ".join(known)),
            )
    return tuple(known[name] for name in asked)


def _virtual_session(folder: Path) -> Path:
    """Simulate the virtual sensor, unless an earlier ablation did it."""
    if not (folder / "session.toml").is_file():
        with StageProgress() as progress:
            simulate_session(SensorDesign(), folder, progress=progress)
    return folder
