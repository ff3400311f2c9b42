"""The manifest of a calibration file: every number that is not an array, quick to read.

The sensor library shows many calibrations; reading only their manifests takes a millisecond each,
and needs no numerical libraries.
"""

from __future__ import annotations

import hashlib
import math
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gelpolight_core.base.file_texts import text_of_file
from gelpolight_core.base.finding import (
    Finding,
    QualityTable,
    Verdict,
    calibration_fault,
    join_quality_tables,
)
from gelpolight_core.base.safe_reading import (
    OWN_LIMIT,
    check_version,
    invalid_file_guard,
    missing_file,
    multiline_text,
    open_zip,
    parse_json,
    read_member,
    short_repr,
)
from gelpolight_core.session.validation import Validation, validation_in

FORMAT = "gelpolight-calibration"
# Version 1 has no membrane curves, standard deviations, manual edits or camera response.
# Version 3 adds closed sensors; version 4 stores texts with templates and values. Version 5 is laid
# out as the dataclasses are, and its identity must follow from its numbers. Version 6 has terms of
# the light, and what held-out presses say of each term.
VERSION = 6
FIRST_NESTED = 5
"""From this version on, a file is laid out as the dataclasses are."""
MANIFEST = "manifest.json"
REMARK_LENGTH = 200
HEAD_LIMIT = 4096
KINDS = ("<f4", "<f8", "<i4")


@dataclass(frozen=True, slots=True)
class CalibrationSummary:
    """Contents of a calibration file without its arrays.

    Attributes
    ----------
    identity, serial, model : str
        Short name of the calibration, its sensor and its model.
    created, operator, program_version, session, inputs : str
        As in its provenance.
    image_size : tuple of int
        Width and height of the camera images, px.
    quality : mapping
        Quality table of every stage, in order.
    accepted : str
        As in its provenance.
    camera : str
        Identity of the camera. Empty if unknown.
    validation : Validation or None
        On an object of known size, passed or not.
    sources : frozenset of str
        SHA-256 of each file that it was made from.
    """

    identity: str
    serial: str
    model: str
    created: str
    operator: str
    program_version: str
    session: str
    inputs: str
    image_size: tuple[int, int]
    quality: Mapping[str, QualityTable]
    accepted: str = ""
    camera: str = ""
    validation: Validation | None = None
    sources: frozenset[str] = frozenset()

    @property
    def verdict(self) -> Verdict:
        """The worst verdict of all stages."""
        return join_quality_tables(self.quality.values()).verdict

    @property
    def fault(self) -> Finding | None:
        """The failed figures, or None."""
        return calibration_fault(self.quality)


def read_summary(path: Path) -> CalibrationSummary:
    """Read the summary of a calibration file.

    The manifest is checked as in
    :func:`~gelpolight_core.calibration.calibration_file.read_calibration`, and every part must
    exist; the content of the arrays is not checked.

    Raises
    ------
    InputError
        If the file is missing, damaged, truncated or has a newer version.
    """
    with open_archive(path) as archive:
        manifest = read_manifest(archive, path)
        manifest["grid"]
        check_arrays(manifest["arrays"], archive)
        return _summarise(manifest, path)


def refuse_damaged_arrays(path: Path) -> None:
    """Compare every array of a calibration file with its checksum, without loading it.

    Raises
    ------
    InputError
        If one of them, or the file, is damaged.
    """
    with open_archive(path) as archive:
        arrays = read_manifest(archive, path)["arrays"]
        check_arrays(arrays, archive)
        for name, entry in arrays.items():
            with archive.open(f"{name}.npy") as stream:
                # typeshed describes the reader of a zip as a plain byte stream only
                digest = hashlib.file_digest(stream, "sha256")  # type: ignore[arg-type]
            if digest.hexdigest() != entry["sha256"]:
                raise ValueError(f"the checksum of {name} is wrong")


def _summarise(manifest: dict[str, Any], path: Path) -> CalibrationSummary:
    provenance = manifest["provenance"]
    texts = {key: manifest[key] for key in ("identity", "serial", "model")}
    texts |= {key: provenance[key] for key in ("created", "operator", "program_version", "session")}
    texts |= {key: provenance.get(key, "") for key in ("inputs", "accepted")}
    texts["camera"] = provenance.get("camera_settings", {}).get("identity", "")
    width, height = manifest["image_size"]
    return CalibrationSummary(
        **{key: multiline_text(text) for key, text in texts.items()},
        image_size=(int(width), int(height)),
        quality={stage: read_quality(rows) for stage, rows in manifest["quality"].items()},
        validation=validation_in(manifest, path),
        sources=frozenset(map(multiline_text, provenance.get("sources", {}).values())),
    )


def read_manifest(archive: zipfile.ZipFile, path: Path) -> dict[str, Any]:
    """Return the manifest of an open file after its format, version and checksum are checked."""
    text = read_member(archive, MANIFEST, OWN_LIMIT)
    manifest: dict[str, Any] = parse_json(text)
    check_version(manifest, FORMAT, VERSION, path)
    checksum = read_member(archive, f"{MANIFEST}.sha256", 64)
    if hashlib.sha256(text).hexdigest().encode() != checksum:
        raise ValueError("the manifest's checksum is wrong")
    return _with_head(manifest)


def _with_head(manifest: dict[str, Any]) -> dict[str, Any]:
    """Return the manifest of any version with the entries of today that need no array."""
    # Older programs kept the name of the elastomer.
    provenance = {key: value for key, value in manifest["provenance"].items() if key != "elastomer"}
    if manifest["version"] >= FIRST_NESTED:
        return {**manifest, "provenance": provenance}
    camera = manifest["camera"]
    return {
        **manifest,
        "serial": manifest["sensor"]["serial"],
        "image_size": [camera["width"], camera["height"]],
        "provenance": {**provenance, "accepted": manifest.get("accepted", "")},
    }


def read_quality(rows: list[dict[str, Any]]) -> QualityTable:
    """Return a quality table from its rows, also of older files."""
    return QualityTable(tuple(_figure(row) for row in rows))


def _figure(row: dict[str, Any]) -> Finding:
    warn, fail = (None if row[key] is None else _number(row[key]) for key in _LIMITS)
    return Finding(
        multiline_text(row["key"]),
        text_of_file(row["label"]),
        _number(row["value"]),
        multiline_text(row["unit"]),
        warn,
        fail,
        Verdict(row["verdict"]),
        text_of_file(row["advice"]),
    )


_LIMITS = ("warn_limit", "fail_limit")


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{short_repr(value)} is not a number")
    return value


def declared_bytes(name: str, entry: dict[str, Any]) -> int:
    """Return the number of bytes of an array as declared in the manifest.

    Raises
    ------
    ValueError
        If the declaration is invalid.
    """
    shape, kind = entry["shape"], entry["kind"]
    if not isinstance(shape, list) or not 1 <= len(shape) <= 4:
        raise ValueError(f"{short_repr(name)} has no shape")
    if not all(type(n) is int and 1 <= n <= 10**9 for n in shape) or kind not in KINDS:
        raise ValueError(
            f"{short_repr(name)} has the invalid type {short_repr(kind)} {short_repr(shape)}"
        )
    return math.prod(shape) * int(kind[-1])


def check_arrays(arrays: Mapping[str, dict[str, Any]], archive: zipfile.ZipFile) -> None:
    """Refuse arrays that declare far more than a file of this size can contain.

    Raises
    ------
    ValueError
        If they do, or if a member of the archive declares more than its array.
    """
    if not isinstance(arrays, dict) or len(arrays) > 64:
        raise ValueError("the list of arrays is not a table")
    for name, entry in arrays.items():
        info = archive.getinfo(f"{name}.npy")
        if info.file_size > declared_bytes(name, entry) + HEAD_LIMIT:
            raise ValueError(f"{short_repr(name)} declares {info.file_size} bytes")


@contextmanager
def open_archive(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open a calibration file as a zip archive, and refuse it if its content is invalid.

    Raises
    ------
    InputError
        If the file does not exist or cannot be read, or if an error of damaged archives, texts or
        values is raised while it is open.
    """
    if not path.is_file():
        raise missing_file(path)
    with (
        invalid_file_guard("The file is damaged, or is not a calibration ({error})", path),
        open_zip(path) as archive,
    ):
        yield archive
