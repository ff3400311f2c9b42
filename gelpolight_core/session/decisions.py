"""The user's decisions about the images of a session: ``decisions.toml`` beside ``session.toml``.

Detection makes a proposal and the user corrects it where it is wrong. The corrections are stored
apart from the captured images, so they can be undone, and the desktop program and the command line
both use them: they give the same calibration.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from itertools import pairwise
from pathlib import Path
from typing import Any

import tomli_w

from gelpolight_core.base.arrays import PointXY
from gelpolight_core.base.atomic_write import write_text
from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.codec import pack, unpack
from gelpolight_core.base.safe_reading import (
    OWN_LIMIT,
    check_version,
    invalid_file_guard,
    parse_toml,
    read_file,
)

FILE_NAME = "decisions.toml"
FORMAT = "gelpolight-decisions"
VERSION = 1
MOST_NODES = 200
PLACED_SD_PX = 0.5
"""Accuracy of a careful person who places something on a magnified image."""


@dataclass(frozen=True, slots=True)
class PlacedCircle:
    """The edge of a contact, drawn by hand in the raw image, in pixels."""

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
    spots_px: Mapping[int, PointXY] = field(default_factory=dict)
    balls: Mapping[str, PlacedCircle] = field(default_factory=dict)
    curves: Mapping[int, tuple[PointXY, ...]] = field(default_factory=dict)


def read_decisions(folder: Path) -> Decisions:
    """Read the decisions of a session. There are none without the file.

    Raises
    ------
    InputError
        If the file is damaged, has a newer version, or contains invalid entries.
    """
    path = folder / FILE_NAME
    try:
        data = read_file(path, OWN_LIMIT)
    except FileNotFoundError:
        return Decisions()
    with invalid_file_guard("The decisions cannot be used ({error})", path):
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
    d, names = decisions, CHANNEL_KEYS
    stored = _DecisionsFile(
        tuple(sorted(d.excluded)),
        {names[led]: point for led, point in sorted(d.spots_px.items())},
        {name: (c.u_px, c.v_px, c.radius_px) for name, c in sorted(d.balls.items())},
        {names[channel]: nodes for channel, nodes in sorted(d.curves.items())},
    )
    content = {"format": FORMAT, "version": VERSION, **pack(stored, {}, "decisions")}
    write_text(folder / FILE_NAME, tomli_w.dumps(content), inside=folder)


@dataclass(frozen=True, slots=True)
class _DecisionsFile:
    """The decisions as they are laid out in the file."""

    excluded: tuple[str, ...] = ()
    mirror_spots_px: Mapping[str, PointXY] = field(default_factory=dict)
    balls_px: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    reflectance_nodes: Mapping[str, tuple[PointXY, ...]] = field(default_factory=dict)


def _parse(content: Mapping[str, Any]) -> Decisions:
    entries = {f.name: content[f.name] for f in fields(_DecisionsFile) if f.name in content}
    stored = unpack(_DecisionsFile, entries, {}, "decisions")
    channel = CHANNEL_KEYS.index
    return Decisions(
        frozenset(stored.excluded),
        {channel(key): point for key, point in stored.mirror_spots_px.items()},
        {name: _circle(*circle) for name, circle in stored.balls_px.items()},
        {channel(key): _nodes(nodes) for key, nodes in stored.reflectance_nodes.items()},
    )


def _circle(u: float, v: float, radius: float) -> PlacedCircle:
    if radius <= 0.0:
        raise ValueError(f"{radius:g} px is not a valid radius")
    return PlacedCircle(u, v, radius)


def _nodes(nodes: tuple[PointXY, ...]) -> tuple[PointXY, ...]:
    if not 2 <= len(nodes) <= MOST_NODES:
        raise ValueError(f"a curve needs 2 to {MOST_NODES} nodes")
    for (c0, v0), (c1, v1) in pairwise(nodes):
        if not (c1 > c0 and v1 >= v0):
            raise ValueError("the nodes of a curve are not increasing")
    return nodes
