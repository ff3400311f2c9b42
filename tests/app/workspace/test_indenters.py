"""The lab's list of known indenters."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.workspace.indenters import (
    FILE,
    Indenter,
    first_indenters,
    read_indenters,
    write_indenters,
)
from gelpolight_core.errors import InputError


def test_a_new_workspace_knows_the_papers_indenters(tmp_path: Path) -> None:
    known = read_indenters(tmp_path)
    assert known == first_indenters()
    for shape in ("cylinder", "cuboid"):
        sizes = {(i.size_mm, i.height_mm) for i in known if i.shape == shape}
        assert {(3.0, 1.0), (7.0, 1.0), (5.0, 0.5), (5.0, 1.5)} <= sizes


def test_an_edited_list_is_saved(tmp_path: Path) -> None:
    wanted = (Indenter("Gauge block", "cuboid", 4.0, 6.0, 1.25), Indenter("Marble", "ball", 16.0))
    write_indenters(wanted, tmp_path)
    assert read_indenters(tmp_path) == wanted
    assert wanted[0].mean_size_mm == 5.0


@pytest.mark.parametrize("length", [0.0, -3.0, float("nan"), float("inf")])
def test_a_length_of_zero_or_less_is_refused(length: float) -> None:
    with pytest.raises(InputError, match="greater than zero"):
        Indenter("Pin", "cylinder", length)
    with pytest.raises(InputError, match="greater than zero"):
        Indenter("Pin", "cylinder", 3.0, height_mm=length)


def test_equal_indenter_names_are_refused_and_the_old_list_stays(tmp_path: Path) -> None:
    write_indenters((Indenter("Pin", "cylinder", 3.0),), tmp_path)
    twins = (Indenter("Pin", "cylinder", 3.0), Indenter("Pin", "ball", 4.0))
    with pytest.raises(InputError, match="the name Pin"):
        write_indenters(twins, tmp_path)
    assert len(read_indenters(tmp_path)) == 1


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        '{"format": "another"}',
        '{"format": "gelpolight-indenters", "version": 1, "indenters": [{"name": "Pin"}]}',
        '{"format": "gelpolight-indenters", "version": 1, "indenters":'
        ' [{"name": "Pin", "shape": "ball", "size_mm": true}]}',
        '{"format": "gelpolight-indenters", "version": 9, "indenters": []}',
    ],
)
def test_a_damaged_or_newer_list_is_refused_with_the_files_name(tmp_path: Path, text: str) -> None:
    (tmp_path / FILE).write_text(text)
    with pytest.raises(InputError) as refusal:
        read_indenters(tmp_path)
    assert FILE in str(refusal.value)
