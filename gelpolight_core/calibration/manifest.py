"""The manifest of a calibration file: every number that is not an array, quick to read.

The library of sensors shows many calibrations; reading their manifests alone takes a millisecond
each, and loads none of the numerical libraries.
"""

from __future__ import annotations

import hashlib
import json
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gelpolight_core.errors import InputError
from gelpolight_core.quality import Figure, QualityTable, Verdict
from gelpolight_core.translation import tr

FORMAT = "gelpolight-calibration"
# 1: without the membrane's curves, its deviations, edits by hand and the camera's response.
VERSION = 2
MANIFEST = "manifest.json"
MANIFEST_LIMIT = 4_000_000
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
    if not path.is_file():
        raise missing(path)
    try:
        with zipfile.ZipFile(path) as archive:
            manifest = read_manifest(archive, path)
            for part in ("plane", "grid"):
                manifest[part]
            for name in manifest["arrays"]:
                archive.getinfo(f"{name}.npy")
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
        with zipfile.ZipFile(path) as archive:
            for name, entry in read_manifest(archive, path)["arrays"].items():
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
    for key, text in texts.items():
        if not isinstance(text, str):
            raise ValueError(f"{key} is no text")
    return CalibrationSummary(
        **texts,
        picture_size=(int(camera["width"]), int(camera["height"])),
        quality={stage: read_quality(rows) for stage, rows in manifest["quality"].items()},
    )


def read_manifest(archive: zipfile.ZipFile, path: Path) -> dict[str, Any]:
    """Return the manifest of an open file after its format, version and checksum are checked."""
    text = read_member(archive, MANIFEST, MANIFEST_LIMIT)
    manifest = json.loads(text)
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise ValueError("no calibration manifest")
    version = manifest.get("version")
    if type(version) is int and version > VERSION:
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
    with archive.open(info) as stream:
        data = stream.read(limit + 1)
    if len(data) != info.file_size:
        raise ValueError(f"{name} is cut short")
    return data


def read_quality(rows: list[dict[str, Any]]) -> QualityTable:
    """Return a quality table from the rows that ``QualityTable.as_rows`` made."""
    return QualityTable(
        tuple(Figure(**{**row, "verdict": Verdict(row["verdict"])}) for row in rows)
    )


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
            error=str(error).splitlines()[0] if str(error) else type(error).__name__
        ),
        where=str(path),
        advice=tr("Take a copy, or calibrate again from the session"),
    )
