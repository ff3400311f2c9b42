"""``gelpolight records``: the measurements of the lab's sensors."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from app.command_line.common import refuse_overwriting
from app.command_line.terminal import harmless, say
from app.workspace.workspace import default_folder
from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import refuse_unwritable
from gelpolight_core.records.entry import MeasurementRecord, Quantity
from gelpolight_core.records.records import NAME, Records
from gelpolight_core.translation import tr

_LINE = "{:>6}  {:<16}  {:<14}  {:<12}  {:<14} {:>10} {:>9} {:>10} {:>8}  {:<8}  {}"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command and its function."""
    parser.add_argument(
        "--workspace",
        type=Path,
        default=default_folder(),
        metavar="DIR",
        help=tr("the workspace folder (default: {folder})").format(folder=default_folder()),
    )
    parser.add_argument("--sensor", metavar="SERIAL", help=tr("only measurements of this sensor"))
    parser.add_argument("--csv", type=Path, metavar="FILE", help=tr("also write a table"))
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print a table, and write one."""
    path = options.workspace / NAME
    if not path.is_file():
        raise InputError(
            tr("There are no records"),
            where=str(path),
            advice=tr("Give the workspace folder with --workspace, or measure something first"),
        )
    if options.csv is not None:
        refuse_overwriting([options.csv], [path])
        refuse_unwritable(options.csv)
    with Records.open(path) as records:
        if records.notice:
            say(records.notice, file=sys.stderr)
        found = records.measurements(options.sensor)
        say("\n".join(table_lines(found)))
        if options.csv is not None:
            records.export_csv(options.csv, options.sensor)
    return 0


def table_lines(records: tuple[MeasurementRecord, ...]) -> list[str]:
    """Return the measurements as lines of text, one per measured value."""
    head = _LINE.format(
        "id", tr("time (UTC)"), tr("sensor"), tr("shape"), tr("quantity"), tr("measured"),
        "sd", tr("true"), tr("error %"), tr("verdict"), tr("note"),
    )  # fmt: skip
    lines = [head]
    for record in records:
        for quantity in record.quantities:
            lines.append(_line(record, quantity))
    return [line.rstrip() for line in lines]


def _line(record: MeasurementRecord, quantity: Quantity) -> str:
    first = quantity is record.quantities[0]
    error = quantity.error_percent
    return _LINE.format(
        record.id if first else "",
        f"{record.time:%Y-%m-%d %H:%M}" if first else "",
        harmless(record.serial) if first else "",
        harmless(record.shape) if first else "",
        harmless(quantity.name),
        f"{quantity.value:.4f}",
        "" if quantity.sd is None else f"{quantity.sd:.4f}",
        "" if quantity.truth is None else f"{quantity.truth:.4f}",
        "" if error is None else f"{error:+.2f}",
        harmless(record.verdict) if first else "",
        harmless(record.note.replace("\n", " ")) if first else "",
    )
