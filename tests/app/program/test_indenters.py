"""The lab's list of known indenters."""

from dataclasses import replace

import pytest

from app.program.indenters import FILE, first_indenters, read_indenters, write_indenters
from gelpolight_core.base.errors import InputError
from gelpolight_core.session.reference_object import ReferenceObject, check_named


def test_a_new_workspace_knows_the_papers_indenters(tmp_path):
    known = read_indenters(tmp_path)
    assert known == first_indenters()
    for shape in ("cylinder", "cuboid"):
        sizes = {(i.size_mm, i.height_mm) for i in known if i.shape == shape}
        assert {(3.0, 1.0), (7.0, 1.0), (5.0, 0.5), (5.0, 1.5)} <= sizes


@pytest.mark.function("Keep a list of the lab's indenters")
def test_an_edited_list_is_saved(tmp_path):
    wanted = (
        ReferenceObject("cuboid", 4.0, second_mm=6.0, height_mm=1.25, name="Gauge block"),
        ReferenceObject("ball", 16.0, name="Marble"),
    )
    write_indenters(wanted, tmp_path)
    assert read_indenters(tmp_path) == wanted
    assert wanted[0].mean_size_mm == 5.0


@pytest.mark.parametrize("length", [-3.0, float("nan"), float("inf")])
def test_an_impossible_length_or_no_size_is_refused(length):
    for pin in (
        ReferenceObject("cylinder", length),
        ReferenceObject("cylinder", 3.0, height_mm=length),
        ReferenceObject(),
    ):
        with pytest.raises(InputError, match=r"not a number from 0 to|size is 0"):
            check_named(replace(pin, name="Pin"))


def test_equal_indenter_names_are_refused_and_the_old_list_stays(tmp_path):
    write_indenters((ReferenceObject("cylinder", 3.0, name="Pin"),), tmp_path)
    twins = (ReferenceObject("cylinder", 3.0, name="Pin"), ReferenceObject("ball", 4.0, name="Pin"))
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
def test_a_damaged_or_newer_list_is_refused_with_the_files_name(tmp_path, text):
    (tmp_path / FILE).write_text(text)
    with pytest.raises(InputError) as refusal:
        read_indenters(tmp_path)
    assert FILE in str(refusal.value)
