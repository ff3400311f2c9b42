"""The elastomer of a calibration: stated in the session or later, and optional."""

from __future__ import annotations

import json
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest
import scene

from gelpolight_core.calibration.elastomer import name_elastomer
from gelpolight_core.calibration.file import MANIFEST, read_calibration, write_calibration
from gelpolight_core.calibration.manifest import read_summary
from gelpolight_core.calibration.provenance import provenance_of
from gelpolight_core.errors import InputError
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.session.closed import ClosedSession, read_any_session
from gelpolight_core.session.description import create_session
from gelpolight_core.session.session import Session


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "c.gplcal"
    write_calibration(scene.calibration(), path)
    return path


def test_it_is_named_later_without_changing_the_calibration(file: Path) -> None:
    before = read_calibration(file)
    with zipfile.ZipFile(file) as archive:
        assert "elastomer" not in json.loads(archive.read(MANIFEST))
    name_elastomer(file, " gel 7 ")
    after = read_calibration(file)
    assert after.provenance == replace(before.provenance, elastomer="gel 7")
    assert after.identity == before.identity
    assert read_summary(file).elastomer == "gel 7"
    name_elastomer(file, "")
    assert read_summary(file).elastomer == ""


@pytest.mark.parametrize("name", ["x" * 81, "gel\x00"])
def test_a_name_that_cannot_be_shown_is_refused(file: Path, name: str) -> None:
    with pytest.raises(InputError, match="elastomer"):
        name_elastomer(file, name)
    assert read_summary(file).elastomer == ""


@pytest.mark.parametrize("elastomer", ["gel 7", ""])
def test_a_session_states_it_and_its_calibration_keeps_it(tmp_path: Path, elastomer: str) -> None:
    sensor, board = scene.calibration().sensor, BoardSpec((9, 6), 3.0)
    stated = (
        Session(tmp_path / "open", sensor, board, board, {}, 3.0, elastomer=elastomer),
        ClosedSession(tmp_path / "closed", "S", 0.06, elastomer=elastomer),
    )
    for session in stated:
        create_session(session)
        again = read_any_session(session.folder)
        assert again.elastomer == elastomer
        assert provenance_of(again, ()).elastomer == elastomer
