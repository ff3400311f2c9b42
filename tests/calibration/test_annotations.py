"""Why a failed calibration is used, in its file; and the elastomer's name, of older files."""

import hashlib
import json
import zipfile
from dataclasses import replace

import pytest
import scene

from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.annotations import write_reason
from gelpolight_core.calibration.calibration_file import (
    MANIFEST,
    read_calibration,
    write_calibration,
)
from gelpolight_core.calibration.manifest import read_summary
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.session.description import create_session
from gelpolight_core.session.session import ClosedSensorSettings, SensorData, Session, read_session


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "c.gplcal"
    write_calibration(scene.calibration(), path)
    return path


def test_it_is_written_later_without_changing_the_calibration(file):
    before = read_calibration(file)
    write_reason(" for teaching ", file)
    after = read_calibration(file)
    assert after.provenance == replace(before.provenance, accepted="for teaching")
    assert after.identity == before.identity
    assert read_summary(file).accepted == "for teaching"
    write_reason("", file)
    assert read_summary(file).accepted == ""


@pytest.mark.parametrize("reason", ["x" * 201, "teaching\x00"])
def test_a_text_that_cannot_be_shown_is_refused(file, reason):
    with pytest.raises(InputError, match="plain text"):
        write_reason(reason, file)
    assert read_summary(file).accepted == ""


def test_files_with_the_name_of_an_elastomer_are_read(file, tmp_path):
    with zipfile.ZipFile(file) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    manifest = json.loads(parts[MANIFEST])
    manifest["provenance"]["elastomer"] = "gel 7"
    parts[MANIFEST] = json.dumps(manifest).encode()
    parts[f"{MANIFEST}.sha256"] = hashlib.sha256(parts[MANIFEST]).hexdigest().encode()
    older = tmp_path / "older.gplcal"
    with zipfile.ZipFile(older, "w") as archive:
        for name, part in parts.items():
            archive.writestr(name, part)
    assert read_calibration(older).identity == read_calibration(file).identity
    sensor, board = scene.calibration().data.sensor, BoardSpec((9, 6), 3.0)
    closed = ClosedSensorSettings((0.06, 0.06))
    for session in (
        Session(tmp_path / "open", sensor, board, board, ball_default_radius_mm=3.0),
        Session(tmp_path / "closed", SensorData("S"), in_place=closed),
    ):
        create_session(session)
        path = session.folder / "session.toml"
        path.write_text(path.read_text().replace("[sensor]", '[sensor]\nelastomer = "gel 7"'))
        assert read_session(session.folder).serial == session.serial
