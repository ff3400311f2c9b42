"""``gelpolight records``: the measurements of the lab's sensors."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.program.workspace import default_folder
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.lab.measurement_record import MeasurementRecord
from gelpolight_core.lab.measurement_store import NAME, open_records, write_csv

from .options import Command, option, refuse_overwriting, result_option
from .terminal import escape_control, print_safe

_LINE = "{:>6}  {:<16}  {:<14}  {:<12}  {:<14} {:>10} {:>9} {:>10} {:>8}  {:<8}  {}"


@dataclass(frozen=True)
class RecordsCommand(Command):
    """Earlier measurements."""

    workspace: Path = option(
        f"the workspace folder (default: {default_folder()})",
        default=default_folder(),
        metavar="DIR",
    )
    sensor: str | None = option("only measurements of this sensor", metavar="SERIAL")
    csv: Path | None = result_option("also write a table")

    def run(self) -> None:
        """Print a table, and write one."""
        file = self.workspace / NAME
        if not file.is_file():
            raise InputError(
                "There are no records", file, Remedy.STATE_WITH.format(option="--workspace")
            )
        refuse_overwriting([self.csv] if self.csv else [], [file])
        with open_records(file) as store:
            records = store.all(MeasurementRecord, serial=self.sensor)
        print_safe("\n".join(table_lines(records)))
        if self.csv:
            write_csv(records, self.csv)


def table_lines(records: tuple[MeasurementRecord, ...]) -> list[str]:
    """Return the measurements as lines of text, one per measured value."""
    columns = "id", "time (UTC)", "sensor", "shape", "quantity"
    numbers = "measured", "sd", "true", "error %"
    lines = [_LINE.format(*columns, *numbers, "verdict", "note")]
    for record in records:
        origin = (str(record.id), f"{record.time:%Y-%m-%d %H:%M}", record.serial, record.shape)
        remarks = record.verdict, record.note.replace("\n", " ")
        for quantity in record.quantities:
            lengths = ((value, ".4f") for value in (quantity.value, quantity.sd, quantity.truth))
            values = *lengths, (quantity.error_percent, "+.2f")
            texts = ("" if value is None else f"{value:{form}}" for value, form in values)
            cells = (*origin, quantity.name, *texts, *remarks)
            lines.append(_LINE.format(*(escape_control(str(cell)) for cell in cells)))
            origin, remarks = ("", "", "", ""), ("", "")  # once for each record
    return [line.rstrip() for line in lines]
