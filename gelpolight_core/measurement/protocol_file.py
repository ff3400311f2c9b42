"""``protocol.toml``: the objects and presses of a protocol run, and its sensor."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import write_text
from gelpolight_core.io.reading import brief, parse_toml, read_file
from gelpolight_core.measurement.protocol import Protocol, check_protocol
from gelpolight_core.measurement.truth import LONGEST_MM
from gelpolight_core.session.table import Table
from gelpolight_core.translation import tr

FILE_NAME = "protocol.toml"
FORMAT = "gelpolight-protocol"
VERSION = 1
SIZE_LIMIT = 100_000


@dataclass(frozen=True, slots=True)
class ProtocolFile:
    """The content of ``protocol.toml``.

    Attributes
    ----------
    protocol : Protocol
        What is pressed.
    serial : str
        The sensor's.
    calibration : str
        Identity of the calibration that the run began with.
    """

    protocol: Protocol
    serial: str
    calibration: str


def write_protocol_file(content: ProtocolFile, folder: Path) -> None:
    """Write ``protocol.toml``, completely or not at all.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    p = content.protocol
    table = {
        "format": FORMAT,
        "version": VERSION,
        "sensor": {"serial": content.serial, "calibration": content.calibration},
        "objects": {
            "shapes": list(p.shapes),
            "sizes_mm": list(p.sizes_mm),
            "at_height_mm": p.at_height_mm,
            "heights_mm": list(p.heights_mm),
            "at_size_mm": p.at_size_mm,
        },
        "places": {
            "repeats": p.repeats,
            "regions": p.regions,
            "reach_mm": p.reach_mm,
            "seed": p.seed,
        },
    }

    write_text(folder / FILE_NAME, tomli_w.dumps(table))


def read_protocol_file(folder: Path) -> ProtocolFile:
    """Read and check ``protocol.toml``.

    Raises
    ------
    InputError
        If it is missing, is not TOML, has another format or a newer version, or a key that is
        unknown, missing, of the wrong kind or out of range.
    """
    path = folder / FILE_NAME
    try:
        content = parse_toml(read_file(path, SIZE_LIMIT))
    except FileNotFoundError as error:
        raise InputError(
            tr("there is no {name}").format(name=FILE_NAME),
            where=str(folder),
            advice=tr("Name the folder of a run of the evaluation protocol"),
        ) from error
    except ValueError as error:
        raise InputError(
            tr("the protocol cannot be read ({reason})").format(reason=brief(str(error), 200)),
            where=str(path),
            advice=tr("Correct the file; the presses in the folder are intact"),
        ) from error
    return _parse(Table(content, "", path))


def _parse(top: Table) -> ProtocolFile:
    top.check_version(FORMAT, VERSION)
    sensor, objects, places = (top.table(name) for name in ("sensor", "objects", "places"))
    top.no_more("format", "version", "sensor", "objects", "places")
    sensor.no_more("serial", "calibration")
    objects.no_more("shapes", "sizes_mm", "at_height_mm", "heights_mm", "at_size_mm")
    places.no_more("repeats", "regions", "reach_mm", "seed")
    protocol = Protocol(
        shapes=_texts(objects, "shapes"),
        sizes_mm=_lengths(objects, "sizes_mm"),
        heights_mm=_lengths(objects, "heights_mm"),
        at_size_mm=objects.number("at_size_mm", 0.05, 200.0),
        at_height_mm=objects.number("at_height_mm", 0.05, 200.0),
        repeats=places.whole("repeats"),
        regions=places.whole("regions"),
        reach_mm=places.number("reach_mm", 0.05, 200.0),
        seed=places.whole("seed"),
    )
    if protocol.seed < 0:
        raise places.wrong("seed", tr("is below zero"))
    checked = check_protocol(protocol, where=str(top.path))
    return ProtocolFile(checked, sensor.text("serial"), sensor.text("calibration"))


def _texts(table: Table, key: str) -> tuple[str, ...]:
    value: Any = table.content.get(key)
    if not isinstance(value, list) or not all(isinstance(text, str) for text in value):
        raise table.wrong(key, tr("is not a list of texts"))
    return tuple(brief(text) for text in value)


def _lengths(table: Table, key: str) -> tuple[float, ...]:
    value: Any = table.content.get(key)
    if not isinstance(value, list) or not all(
        type(x) in (int, float) and abs(x) <= LONGEST_MM for x in value
    ):
        raise table.wrong(key, tr("is not a list of lengths"))
    return tuple(float(x) for x in value)
