"""The presses since a calibration are kept in the workspace."""

import pytest

from app.workspace.gel_care import FILE, read_presses, write_presses
from gelpolight_core.errors import InputError


def test_it_comes_back_and_a_workspace_without_it_has_none(tmp_path):
    assert read_presses(tmp_path / "new") == {}
    presses = {"S-1": 3, "S-2": 0}
    write_presses(presses, tmp_path / "new")
    assert read_presses(tmp_path / "new") == presses
    (tmp_path / FILE).write_text(
        '{"format": "gelpolight-gel-care", "version": 1, "calibrations": '
        '{"S": {"presses": 7, "first_s": [0.5], "last_s": [0.8]}}}'
    )
    assert read_presses(tmp_path) == {"S": 7}


@pytest.mark.parametrize(
    "text",
    [
        "{",
        '{"format": "other"}',
        '{"format": "gelpolight-gel-care", "version": 1}',
        '{"format": "gelpolight-gel-care", "version": 3, "calibrations": {}}',
        '{"format": "gelpolight-gel-care", "version": 1, "calibrations": {"S": {"presses": -1}}}',
    ],
)
def test_a_damaged_or_newer_file_is_refused(tmp_path, text):
    (tmp_path / FILE).write_text(text)
    with pytest.raises(InputError, match=r"list of presses|has version 3"):
        read_presses(tmp_path)
