"""``gelpolight records``: the measurements of the lab's sensors."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from app.command_line.common import check_outputs
from app.command_line.terminal import harmless, say
from app.workspace.workspace import default_folder
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.records.entry import MeasurementRecord
from gelpolight_core.records.records import NAME, Records
from gelpolight_core.translation import tr

_LINE = "{:>6}  {:<16}  {:<14}  {:<12}  {:<14} {:>10} {:>9} {:>10} {:>8}  {:<8}  {}"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "--workspace",
        type=Path,
        default=default_folder(),
        metavar="DIR",
        help=tr("the workspace folder (default: {folder})").format(folder=default_folder()),
    )
    parser.add_argument("--sensor", metavar="SERIAL", help=tr("only measurements of this sensor"))
    parser.add_argument("--csv", type=Path, metavar="FILE", help=tr("also write a table"))


def run(options: argparse.Namespace) -> int:
    """Print a table, and write one."""
    path = options.workspace / NAME
    if not path.is_file():
        raise InputError(
            tr("There are no records"),
            where=path,
            advice=Remedy.STATE_WITH.format(option="--workspace"),
        )
    check_outputs([options.csv], [path])
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
        who = (str(record.id), f"{record.time:%Y-%m-%d %H:%M}", record.serial, record.shape)
        rest = record.verdict, record.note.replace("\n", " ")
        for quantity in record.quantities:
            numbers = (
                "" if value is None else f"{value:{form}}"
                for value, form in (
                    (quantity.value, ".4f"),
                    (quantity.sd, ".4f"),
                    (quantity.truth, ".4f"),
                    (quantity.error_percent, "+.2f"),
                )
            )
            cells = (*who, quantity.name, *numbers, *rest)
            lines.append(_LINE.format(*(harmless(str(cell)) for cell in cells)))
            who, rest = ("", "", "", ""), ("", "")  # once for each record
    return [line.rstrip() for line in lines]
