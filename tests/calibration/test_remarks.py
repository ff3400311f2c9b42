"""Remarks in a calibration file: its elastomer, and why a failed one is used."""

import json
import zipfile
from dataclasses import replace

import pytest
import scene

from gelpolight_core.calibration.file import MANIFEST, read_calibration, write_calibration
from gelpolight_core.calibration.manifest import read_summary
from gelpolight_core.calibration.provenance import provenance_of
from gelpolight_core.calibration.remarks import write_remark
from gelpolight_core.errors import InputError
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.session.description import create_session
from gelpolight_core.session.session import InPlace, SensorData, Session, read_session


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "c.gplcal"
    write_calibration(scene.calibration(), path)
    return path


@pytest.mark.parametrize("key", ["elastomer", "accepted"])
def test_it_is_written_later_without_changing_the_calibration(file, key):
    before = read_calibration(file)
    with zipfile.ZipFile(file) as archive:
        assert key not in json.loads(archive.read(MANIFEST))
    write_remark(file, key, " gel 7 ")
    after = read_calibration(file)
    assert after.provenance == replace(before.provenance, **{key: "gel 7"})
    assert after.identity == before.identity
    assert getattr(read_summary(file), key) == "gel 7"
    write_remark(file, key, "")
    assert getattr(read_summary(file), key) == ""


@pytest.mark.parametrize("name", ["x" * 201, "gel\x00"])
def test_a_text_that_cannot_be_shown_is_refused(file, name):
    with pytest.raises(InputError, match="plain text"):
        write_remark(file, "elastomer", name)
    assert read_summary(file).elastomer == ""


@pytest.mark.parametrize("elastomer", ["gel 7", ""])
def test_a_session_states_it_and_its_calibration_keeps_it(tmp_path, elastomer):
    sensor, board = scene.calibration().data.sensor, BoardSpec((9, 6), 3.0)
    stated = (
        Session(tmp_path / "open", sensor, board, board, {}, 3.0, elastomer=elastomer),
        Session(
            tmp_path / "closed",
            SensorData("S"),
            elastomer=elastomer,
            in_place=InPlace((0.06, 0.06)),
        ),
    )
    for session in stated:
        create_session(session)
        again = read_session(session.folder)
        assert again.elastomer == elastomer
        assert provenance_of(again, ()).elastomer == elastomer
