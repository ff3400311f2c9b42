"""The evaluation protocol of the paper's section VI-B: what is pressed, where and how often.

Objects of sizes 3 to 7 mm at one height, and of heights 0.5 to 1.5 mm at one size, each pressed
five times in one region and once in each of 25 random regions. The position of a press depends only
on the seed and on the press itself. A part of the protocol therefore uses the same positions as the
whole protocol, and a resumed run continues with the same positions. ``protocol.toml`` holds it with
its sensor.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.atomic import write_text
from gelpolight_core.io.reading import brief, parse_toml, read_file
from gelpolight_core.measurement.evaluation import Crossing
from gelpolight_core.measurement.press import LONGEST_MM, Press
from gelpolight_core.measurement.result import Truth
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.table import Table
from gelpolight_core.translation import tr

SHAPES = ("cylinder", "cuboid")
SAME_REGION = "same"
FILE_NAME = "protocol.toml"
FORMAT = "gelpolight-protocol"
VERSION = 1
SIZE_LIMIT = 100_000
ROOM_MM = 2.0
"""Visible ground around every object: three decay lengths of 0.7 mm, where the drape has decreased
to a twentieth of the height."""


@dataclass(frozen=True, slots=True)
class Protocol:
    """The presses of an evaluation. The default is the paper's; any part can be left out.

    Attributes
    ----------
    shapes : tuple of str
        Some of ``cylinder`` and ``cuboid``.
    sizes_mm : tuple of float
        Diameters or sides that are pressed at `at_height_mm`.
    heights_mm : tuple of float
        Heights that are pressed at the size `at_size_mm`.
    at_size_mm, at_height_mm : float
        Size and height of the object that is in both series.
    repeats : int
        Presses of each object in one and the same region.
    regions : int
        Random regions, in each of which each object is pressed once.
    reach_mm : float
        Radius about the sensor frame's origin within which objects and the ground around them lie.
    seed : int
        Of the random places.
    """

    shapes: tuple[str, ...] = SHAPES
    sizes_mm: tuple[float, ...] = (3.0, 4.0, 5.0, 6.0, 7.0)
    heights_mm: tuple[float, ...] = (0.5, 0.75, 1.0, 1.25, 1.5)
    at_size_mm: float = 5.0
    at_height_mm: float = 1.0
    repeats: int = 5
    regions: int = 25
    reach_mm: float = 10.0
    seed: int = 0

    @property
    def objects(self) -> tuple[Truth, ...]:
        """The distinct objects, shape by shape."""
        planar = [(size, self.at_height_mm) for size in self.sizes_mm]
        depth = [(self.at_size_mm, height) for height in self.heights_mm]
        items = tuple(dict.fromkeys(planar + depth))
        return tuple(Truth(shape, *item) for shape in self.shapes for item in items)

    @property
    def crossing(self) -> Crossing:
        """Where its two series cross."""
        return Crossing(self.at_size_mm, self.at_height_mm)

    def presses(self) -> tuple[Press, ...]:
        """Return every press: object by object, first in the same region, then in the random ones.

        Each object is mounted only once.
        """
        return tuple(press for truth in self.objects for press in self._presses_of(truth))

    def _presses_of(self, truth: Truth) -> list[Press]:
        wanted = [
            _press(truth, SAME_REGION, repeat, (0.0, 0.0), 0.0)
            for repeat in range(1, self.repeats + 1)
        ]
        for number in range(1, self.regions + 1):
            region = f"r{number:02d}"
            wanted.append(_press(truth, region, 1, *self._random_position(truth, region)))
        return wanted

    def _random_position(self, truth: Truth, region: str) -> tuple[tuple[float, float], float]:
        """Return a random position with enough room, and a random rotation of a cuboid."""
        name = f"{truth.shape} {truth.size_mm:.3f} {truth.height_mm:.3f} {region}"
        rng = np.random.default_rng([self.seed, zlib.crc32(name.encode())])
        away = room_mm(truth, self.reach_mm) * math.sqrt(rng.random())
        angle = 2.0 * math.pi * rng.random()
        # To hundredths of a millimetre, as they are shown and written.
        position = (round(away * math.cos(angle), 2), round(away * math.sin(angle), 2))
        yaw = round(90.0 * rng.random() - 45.0, 1)
        return position, yaw if truth.shape == "cuboid" else 0.0


def _press(
    truth: Truth, region: str, repeat: int, position_mm: tuple[float, float], yaw_deg: float
) -> Press:
    """Return a press whose image has a unique name in the protocol."""
    size, height = round(100 * truth.size_mm), round(100 * truth.height_mm)
    file = f"{truth.shape}_s{size:03d}_h{height:03d}_{region}_{repeat}.png"
    return Press(file, truth, region, str(repeat), position_mm, yaw_deg)


def room_mm(truth: Truth, reach_mm: float) -> float:
    """Return the largest distance of an object's middle from the origin; <= 0: it has no room.

    Parameters
    ----------
    truth : Truth
        The object.
    reach_mm : float
        Radius within which it and the ground around it must lie.
    """
    half = truth.size_mm / (math.sqrt(2.0) if truth.shape == "cuboid" else 2.0)
    return reach_mm - half - ROOM_MM


def protocol_reach_mm(calibration: Calibration) -> float:
    """Return the radius about the origin within which the whole membrane is visible."""
    table = calibration.table
    grid = table.grid
    away = np.hypot(grid.x_mm[None, :], grid.y_mm[:, None])
    hidden = away[~table.valid]
    edge = min(-grid.x_mm[0], grid.x_mm[-1], -grid.y_mm[0], grid.y_mm[-1])
    return float(min(edge, hidden.min() if hidden.size else edge))


def check_protocol(protocol: Protocol, *, where: str = "protocol") -> Protocol:
    """Check that a protocol can be pressed, and return it.

    Parameters
    ----------
    protocol : Protocol
        To be checked.
    where : str, optional
        File or origin named in the error.

    Raises
    ------
    InputError
        If there is nothing to press, a shape is unknown, a number is out of range or occurs twice,
        or an object has no room.
    """

    def refusal(found: str, advice: str) -> InputError:
        return InputError(found, where=where, advice=advice)

    for shape in protocol.shapes:
        if shape not in SHAPES:
            raise refusal(
                tr("the protocol has no shape '{shape}'").format(shape=shape),
                Remedy.ONE_OF.format(names=", ".join(SHAPES)),
            )
    _check_lengths(protocol, refusal)
    if len(set(protocol.shapes)) < len(protocol.shapes):
        raise refusal(tr("a shape is named twice"), Remedy.CORRECT_VALUE)
    if not protocol.objects:
        raise refusal(tr("the protocol contains no shape with a size"), Remedy.CORRECT_VALUE)
    counts = {tr("repeats"): protocol.repeats, tr("regions"): protocol.regions}
    for name, count in counts.items():
        if not 0 <= count <= 99:
            raise refusal(
                tr("the number of {name} is {count}, not 0 to 99").format(count=count, name=name),
                Remedy.CORRECT_VALUE,
            )
    if protocol.repeats + protocol.regions == 0:
        raise refusal(tr("the protocol has neither repeats nor regions"), Remedy.CORRECT_VALUE)
    for truth in protocol.objects:
        room = room_mm(truth, protocol.reach_mm)
        if room <= 0.0:
            raise refusal(
                tr("a {shape} of {size:g} mm is {mm:.1f} mm too large for {reach:.1f} mm").format(
                    shape=truth.shape, size=truth.size_mm, reach=protocol.reach_mm, mm=-room
                ),
                Remedy.CORRECT_VALUE,
            )
    return protocol


def _check_lengths(protocol: Protocol, refusal: Callable[[str, str], InputError]) -> None:
    lists: dict[str, Sequence[float]] = {
        "sizes_mm": protocol.sizes_mm,
        "heights_mm": protocol.heights_mm,
        "at_size_mm": (protocol.at_size_mm,),
        "at_height_mm": (protocol.at_height_mm,),
        "reach_mm": (protocol.reach_mm,),
    }
    for name, lengths in lists.items():
        for length in lengths:
            if not 0.05 <= length <= 200.0:
                raise refusal(
                    tr("{name} contains {length:g}").format(name=name, length=length),
                    tr("Give lengths from 0.05 to 200 mm"),
                )
        # The names of the images hold hundredths of a millimetre.
        if len({round(100 * length) for length in lengths}) < len(lengths):
            raise refusal(
                tr("{name} contains a length twice").format(name=name), tr("Name each length once")
            )


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
            where=folder,
            advice=Remedy.CHOOSE_FOLDER,
        ) from error
    except ValueError as error:
        raise InputError(
            tr("the protocol cannot be read ({reason})").format(reason=brief(str(error), 200)),
            where=path,
            advice=Remedy.CORRECT_FILE,
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
