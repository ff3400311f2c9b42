"""The presses since a calibration are kept in the workspace."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.workspace.gel_care import FILE, KEPT, GelCare, read_gel_care, write_gel_care
from gelpolight_core.errors import InputError


def test_the_first_and_the_last_recovery_times_are_kept() -> None:
    care = GelCare()
    for n in range(30):
        care = care.later(2, (0.1 * n,))
    assert care.presses == 60
    assert len(care.first_s) == len(care.last_s) == KEPT
    assert care.early_s == pytest.approx(0.45)
    assert care.lately_s == pytest.approx(2.45)
    assert GelCare(3).lately_s is None


def test_it_comes_back_and_a_workspace_without_it_has_none(tmp_path: Path) -> None:
    assert read_gel_care(tmp_path / "new") == {}
    care = {"S-1": GelCare(3, (0.5,), (0.5, 0.7)), "S-2": GelCare()}
    write_gel_care(care, tmp_path / "new")
    assert read_gel_care(tmp_path / "new") == care


@pytest.mark.parametrize(
    "text",
    ["{", '{"format": "other"}', '{"format": "gelpolight-gel-care", "version": 1}',
     '{"format": "gelpolight-gel-care", "version": 2, "calibrations": {}}',
     '{"format": "gelpolight-gel-care", "version": 1, "calibrations": '
     '{"S": {"presses": -1, "first_s": [], "last_s": []}}}'],
)  # fmt: skip
def test_a_damaged_or_newer_file_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / FILE).write_text(text)
    with pytest.raises(InputError, match="list of presses"):
        read_gel_care(tmp_path)
