"""The user's decisions about the images of a session: ``decisions.toml`` beside ``session.toml``.

Detection makes a proposal and the user corrects it where it is wrong. The corrections are stored
apart from the captured images, so they can be undone, and the desktop program and the command line
both use them: they give the same calibration.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import tomli_w

from gelpolight_core.channels import CHANNEL_KEYS
from gelpolight_core.io.atomic import write_text
from gelpolight_core.io.reading import brief, check_version, parse_toml, read_file, refusing
from gelpolight_core.translation import tr

FILE_NAME = "decisions.toml"
FORMAT = "gelpolight-decisions"
VERSION = 1
MOST_NODES = 200
SIZE_LIMIT = 4_000_000

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class PlacedCircle:
    """The edge of a contact, drawn by hand in the raw image; pixels."""

    u_px: float
    v_px: float
    radius_px: float


@dataclass(frozen=True, slots=True)
class Decisions:
    """Corrections made by the user.

    Attributes
    ----------
    excluded : frozenset of str
        Images that are not used, such as ``balls/ball_03.png``.
    spots_px : mapping of int to (u, v)
        Mirror spot of an LED (0, 1, 2), set by hand in the raw image.
    balls : mapping of str to PlacedCircle
        Contact drawn by hand, by the file's name in ``balls``.
    curves : mapping of int to nodes
        Reflectance curve of a channel edited by hand: (cosine, value) nodes, both increasing.
    """

    excluded: frozenset[str] = frozenset()
    spots_px: Mapping[int, Point] = field(default_factory=dict)
    balls: Mapping[str, PlacedCircle] = field(default_factory=dict)
    curves: Mapping[int, tuple[Point, ...]] = field(default_factory=dict)


def read_decisions(folder: Path) -> Decisions:
    """Read the decisions of a session; empty if there is no such file.

    Raises
    ------
    InputError
        If the file is damaged, has a newer version, or contains invalid entries.
    """
    path = folder / FILE_NAME
    try:
        data = read_file(path, SIZE_LIMIT)
    except FileNotFoundError:
        return Decisions()
    with refusing(tr("The decisions cannot be used ({error})"), path):
        content = parse_toml(data)
        check_version(content, FORMAT, VERSION, path)
        return _parse(content)


def write_decisions(decisions: Decisions, folder: Path) -> None:
    """Write the decisions of a session, completely or not at all.

    Parameters
    ----------
    decisions : Decisions
        The user's decisions.
    folder : Path
        The session folder.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    content = {
        "format": FORMAT,
        "version": VERSION,
        "excluded": sorted(decisions.excluded),
        "mirror_spots_px": {
            CHANNEL_KEYS[led]: list(point) for led, point in sorted(decisions.spots_px.items())
        },
        "balls_px": {
            name: [circle.u_px, circle.v_px, circle.radius_px]
            for name, circle in sorted(decisions.balls.items())
        },
        "reflectance_nodes": {
            CHANNEL_KEYS[channel]: [list(node) for node in nodes]
            for channel, nodes in sorted(decisions.curves.items())
        },
    }

    write_text(folder / FILE_NAME, tomli_w.dumps(content), inside=folder)


def _parse(content: Mapping[str, Any]) -> Decisions:
    excluded = content.get("excluded", [])
    if not all(isinstance(name, str) for name in excluded):
        raise ValueError("excluded is not a list of names")
    return Decisions(
        frozenset(excluded),
        {
            CHANNEL_KEYS.index(key): _numbers(point, 2)
            for key, point in content.get("mirror_spots_px", {}).items()
        },
        {
            str(name): PlacedCircle(*_circle(circle))
            for name, circle in content.get("balls_px", {}).items()
        },
        {
            CHANNEL_KEYS.index(key): _nodes(nodes)
            for key, nodes in content.get("reflectance_nodes", {}).items()
        },
    )


def _numbers(values: Any, count: int) -> Any:
    if not isinstance(values, list) or len(values) != count:
        raise ValueError(f"{brief(values)} is not {count} numbers")
    if not all(type(v) in (int, float) and math.isfinite(v) for v in values):
        raise ValueError(f"{brief(values)} is not {count} numbers")
    return tuple(float(v) for v in values)


def _circle(values: Any) -> tuple[float, float, float]:
    u, v, radius = _numbers(values, 3)
    if radius <= 0.0:
        raise ValueError(f"{radius:g} px is not a valid radius")
    return u, v, radius


def _nodes(values: Any) -> tuple[Point, ...]:
    if not isinstance(values, list) or not 2 <= len(values) <= MOST_NODES:
        raise ValueError(f"a curve needs 2 to {MOST_NODES} nodes")
    nodes = tuple(_numbers(node, 2) for node in values)
    for (c0, v0), (c1, v1) in pairwise(nodes):
        if not (c1 > c0 and v1 >= v0):
            raise ValueError("the nodes of a curve are not increasing")
    return nodes
