"""The manifest of a calibration file: every number that is not an array, quick to read.

The library of sensors shows many calibrations; reading their manifests alone takes a millisecond
each, and loads none of the numerical libraries.
"""

from __future__ import annotations

import hashlib
import math
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gelpolight_core.errors import InputError
from gelpolight_core.quality import Figure, QualityTable, Verdict
from gelpolight_core.reading import NEWEST, brief, open_file, parse_json, written_text
from gelpolight_core.translation import tr

FORMAT = "gelpolight-calibration"
# 1: without the membrane's curves, its deviations, edits by hand and the camera's response.
VERSION = 2
MANIFEST = "manifest.json"
MANIFEST_LIMIT = 4_000_000
MOST_ARRAYS = 64
MOST_DIMENSIONS = 4
# What all arrays may declare: a small calibration whole, a larger one this often its file.
DECLARED_LIMIT = 64_000_000
DECLARED_TIMES = 100
HEAD_LIMIT = 4096
# What a damaged zip, a damaged JSON text or values of a wrong kind raise while they are read.
UNREADABLE = (
    zipfile.BadZipFile,
    zlib.error,
    EOFError,
    OSError,
    NotImplementedError,
    RuntimeError,
    RecursionError,
    KeyError,
    IndexError,
    TypeError,
    ValueError,
    AttributeError,
    ArithmeticError,
)


@dataclass(frozen=True, slots=True)
class CalibrationSummary:
    """What a calibration file says of itself, without its arrays.

    Attributes
    ----------
    identity, serial, model : str
        The calibration's short name, its sensor and the model that it was made for.
    created, operator, program_version, session, inputs : str
        As in its provenance.
    picture_size : tuple of int
        Width and height of the camera's pictures, px.
    quality : mapping
        Quality table of every stage, in their order.
    """

    identity: str
    serial: str
    model: str
    created: str
    operator: str
    program_version: str
    session: str
    inputs: str
    picture_size: tuple[int, int]
    quality: Mapping[str, QualityTable]

    @property
    def verdict(self) -> Verdict:
        """The worst verdict of all stages."""
        return QualityTable(tuple(f for t in self.quality.values() for f in t.figures)).verdict


def read_summary(path: Path) -> CalibrationSummary:
    """Read what a calibration file says of itself.

    The manifest is checked as :func:`~gelpolight_core.calibration.file.read_calibration` does it,
    and that every part is there; what the arrays hold is not looked at.

    Raises
    ------
    InputError
        If the file is missing, damaged, truncated or of a newer version.
    """
    try:
        with opened(path) as archive:
            manifest = read_manifest(archive, path)
            for part in ("plane", "grid"):
                manifest[part]
            for name in manifest["arrays"]:
                archive.getinfo(f"{name}.npy")
            refuse_bomb(manifest["arrays"], archive)
        return _summarise(manifest)
    except UNREADABLE as error:
        raise damaged(path, error) from error


def refuse_damaged_arrays(path: Path) -> None:
    """Compare every array of a calibration file with its checksum, without loading it.

    Raises
    ------
    InputError
        If one of them, or the file, is damaged.
    """
    try:
        with opened(path) as archive:
            arrays = read_manifest(archive, path)["arrays"]
            refuse_bomb(arrays, archive)
            for name, entry in arrays.items():
                with archive.open(f"{name}.npy") as stream:
                    # typeshed knows the reader of a zip as a plain byte stream only
                    found = hashlib.file_digest(stream, "sha256")  # type: ignore[arg-type]
                if found.hexdigest() != entry["sha256"]:
                    raise ValueError(f"the checksum of {name} is wrong")
    except UNREADABLE as error:
        raise damaged(path, error) from error


def _summarise(manifest: dict[str, Any]) -> CalibrationSummary:
    provenance, camera = manifest["provenance"], manifest["camera"]
    texts = {
        "identity": manifest["identity"],
        "serial": manifest["sensor"]["serial"],
        "model": manifest["model"],
        **{k: provenance[k] for k in ("created", "operator", "program_version", "session")},
        "inputs": provenance.get("inputs", ""),
    }
    return CalibrationSummary(
        **{key: written_text(text) for key, text in texts.items()},
        picture_size=(int(camera["width"]), int(camera["height"])),
        quality={stage: read_quality(rows) for stage, rows in manifest["quality"].items()},
    )


def read_manifest(archive: zipfile.ZipFile, path: Path) -> dict[str, Any]:
    """Return the manifest of an open file after its format, version and checksum are checked."""
    text = read_member(archive, MANIFEST, MANIFEST_LIMIT)
    manifest = parse_json(text)
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise ValueError("no calibration manifest")
    version = manifest.get("version")
    if type(version) is int and VERSION < version < NEWEST:
        raise InputError(
            tr("the calibration has version {v} and this program knows version {k}").format(
                v=version, k=VERSION
            ),
            where=str(path),
            advice=tr("Use a newer version of GelPoLight Studio"),
        )
    if type(version) is not int or version < 1:
        raise ValueError(f"version {version!r}")
    stated = read_member(archive, f"{MANIFEST}.sha256", 64)
    if hashlib.sha256(text).hexdigest().encode() != stated:
        raise ValueError("the manifest's checksum is wrong")
    return manifest


def read_member(archive: zipfile.ZipFile, name: str, limit: int) -> bytes:
    """Read a member whose declared size is within its limit, before memory is taken."""
    info = archive.getinfo(name)
    if info.file_size > limit:
        raise ValueError(f"{name} declares {info.file_size} bytes")
    # Other packings declare how much memory their unpacking takes.
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"{name} is packed in a way that this program does not use")
    with archive.open(info) as stream:
        data = stream.read(limit + 1)
    if len(data) != info.file_size:
        raise ValueError(f"{name} is cut short")
    return data


def read_quality(rows: list[dict[str, Any]]) -> QualityTable:
    """Return a quality table from the rows that ``QualityTable.as_rows`` made."""
    return QualityTable(tuple(_figure(row) for row in rows))


def _figure(row: dict[str, Any]) -> Figure:
    texts = {key: written_text(row[key]) for key in ("key", "label", "unit", "advice")}
    limits = {key: None if row[key] is None else _number(row[key]) for key in _LIMITS}
    return Figure(**{
        **row, **texts, **limits, "value": _number(row["value"]), "verdict": Verdict(row["verdict"])
    })  # fmt: skip


_LIMITS = ("warn_limit", "fail_limit")


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{brief(value)} is no number")
    return value


def declared_bytes(name: str, entry: dict[str, Any]) -> int:
    """Return what an array takes as its manifest declares it.

    Raises
    ------
    ValueError
        If no array is so.
    """
    shape, kind = entry["shape"], entry["kind"]
    if not isinstance(shape, list) or not 1 <= len(shape) <= MOST_DIMENSIONS:
        raise ValueError(f"{brief(name)} has no shape")
    if not all(type(n) is int and 1 <= n <= 10**9 for n in shape) or kind not in ("<f4", "<f8"):
        raise ValueError(f"{brief(name)} is {brief(kind)} {brief(shape)}")
    return math.prod(shape) * int(kind[-1])


def refuse_bomb(arrays: Mapping[str, dict[str, Any]], archive: zipfile.ZipFile) -> None:
    """Refuse arrays that declare far more than a file of this size can hold.

    Raises
    ------
    ValueError
        If they do, or a member of the archive declares more than its array.
    """
    if not isinstance(arrays, dict) or len(arrays) > MOST_ARRAYS:
        raise ValueError("the list of arrays is none")
    packed = 0
    for name, entry in arrays.items():
        info = archive.getinfo(f"{name}.npy")
        if info.file_size > declared_bytes(name, entry) + HEAD_LIMIT:
            raise ValueError(f"{brief(name)} declares {info.file_size} bytes")
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{brief(name)} is packed in a way that this program does not use")
        packed += info.compress_size
    total = sum(declared_bytes(name, entry) for name, entry in arrays.items())
    if total > max(DECLARED_LIMIT, DECLARED_TIMES * packed):
        raise ValueError(f"its arrays declare {total} bytes")


@contextmanager
def opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open a calibration file as the archive that it is.

    Raises
    ------
    InputError
        If there is no such file, or the system does not give it.
    """
    try:
        stream = open_file(path)
    except FileNotFoundError as error:
        raise missing(path) from error
    with stream, zipfile.ZipFile(stream) as archive:
        yield archive


def missing(path: Path) -> InputError:
    """Return the refusal of a file that is not there."""
    return InputError(
        tr("there is no such file"),
        where=str(path),
        advice=tr("Make one with gelpolight calibrate"),
    )


def damaged(path: Path, error: Exception) -> InputError:
    """Return the refusal of a damaged file."""
    return InputError(
        tr("the calibration is damaged or is not one ({error})").format(
            error=brief(str(error).splitlines()[0], 200) if str(error) else type(error).__name__
        ),
        where=str(path),
        advice=tr("Take a copy, or calibrate again from the session"),
    )
