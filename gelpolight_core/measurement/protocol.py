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
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import tomli_w

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.atomic import write_text
from gelpolight_core.io.codec import unpack
from gelpolight_core.io.reading import (
    brief,
    check_version,
    parse_toml,
    plain_text,
    read_file,
    refusing,
)
from gelpolight_core.measurement.evaluation import Crossing
from gelpolight_core.measurement.press import Press
from gelpolight_core.measurement.statistics import missing_repeats
from gelpolight_core.reference import Truth
from gelpolight_core.sensor_calibration import Calibration

SHAPES = ("cylinder", "cuboid")
SAME_REGION = "same"
FILE_NAME = "protocol.toml"
FORMAT = "gelpolight-protocol"
VERSION = 1
SIZE_LIMIT = 100_000
RANGE_MM = (0.05, 200.0)
"""Lengths of objects."""
TABLES = {
    "objects": ("shapes", "sizes_mm", "at_height_mm", "heights_mm", "at_size_mm"),
    "places": ("repeats", "regions", "reach_mm", "seed"),
}
"""The tables of the file, and the fields of the protocol in each."""
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
        return tuple(
            Truth(shape, size, height_mm=height) for shape in self.shapes for size, height in items
        )

    @property
    def crossing(self) -> Crossing:
        """Where its two series cross."""
        return Crossing(self.at_size_mm, self.at_height_mm)

    @property
    def missing_repeats(self) -> int:
        """How many repeats the standard deviation in one region lacks to be worth stating."""
        return missing_repeats(len(self.objects) * max(self.repeats - 1, 0))

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
    for found, advice in _faults(protocol):
        raise InputError(found, where, advice)
    return protocol


def _faults(protocol: Protocol) -> Iterator[tuple[str, str]]:
    """Yield why a protocol cannot be pressed, with what to do."""
    for shape in protocol.shapes:
        if shape not in SHAPES:
            found = f"the protocol has no shape '{brief(shape)}'"
            yield found, "Choose from {shapes}".format(shapes=", ".join(SHAPES))
    for name in ("sizes_mm", "heights_mm", "at_size_mm", "at_height_mm", "reach_mm"):
        lengths = np.atleast_1d(getattr(protocol, name)).tolist()
        for length in lengths:
            if not RANGE_MM[0] <= length <= RANGE_MM[1]:
                found = f"{name} contains {length:g}"
                advice = "Give lengths from {low:g} to {high:g} mm"
                yield found, advice.format(low=RANGE_MM[0], high=RANGE_MM[1])
        # The names of the images hold hundredths of a millimetre.
        if len({round(100 * length) for length in lengths}) < len(lengths):
            yield (
                f"{name} contains a length twice",
                "Name each length once",
            )
    if len(set(protocol.shapes)) < len(protocol.shapes):
        yield "a shape is named twice", "Name each shape once"
    if not protocol.objects:
        yield "the protocol contains no object", "Choose a shape, and a size or height"
    counts = {"repeats": protocol.repeats, "regions": protocol.regions}
    for name, count in counts.items():
        if not 0 <= count <= 99:
            found = f"the number of {name} is {count}"
            yield found, "Use 0 to 99"
    if protocol.repeats + protocol.regions == 0:
        yield "the protocol contains no press", "State a number of repeats or of regions"
    if protocol.seed < 0:
        yield "the seed is below zero", "Give a seed of 0 or more"
    for truth in protocol.objects:
        room = room_mm(truth, protocol.reach_mm)
        if room <= 0.0:
            found = (
                f"a {truth.shape} of {truth.size_mm:g} mm does not "
                f"fit within {protocol.reach_mm:.1f} mm"
            )
            yield found, f"Leave this size out: {-room:.1f} mm are missing"


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
    values = asdict(content.protocol)
    table = {
        "format": FORMAT,
        "version": VERSION,
        "sensor": {"serial": content.serial, "calibration": content.calibration},
        **{name: {key: values[key] for key in keys} for name, keys in TABLES.items()},
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
    if not path.is_file():
        raise InputError(f"there is no {FILE_NAME}", folder, Remedy.CHOOSE_FOLDER)
    with refusing("the protocol cannot be read ({error})", path):
        content = parse_toml(read_file(path, SIZE_LIMIT))
        check_version(content, FORMAT, VERSION, path)
        if missing := [k for name, keys in TABLES.items() for k in keys if k not in content[name]]:
            raise ValueError(f"{missing[0]} is missing")
        values = {key: value for name in TABLES for key, value in content[name].items()}
        protocol = check_protocol(unpack(Protocol, values, {}, "protocol"), where=str(path))
        sensor = content["sensor"]
        return ProtocolFile(
            protocol, plain_text(sensor["serial"]), plain_text(sensor["calibration"])
        )
