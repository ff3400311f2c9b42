"""The user's decisions are stored beside the images, read back unchanged, and checked."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gelpolight_core.base.errors import InputError
from gelpolight_core.session.decisions import (
    Decisions,
    PlacedCircle,
    read_decisions,
    write_decisions,
)

coordinate = st.floats(-1e4, 1e4, allow_nan=False)
name = st.text(min_size=1, max_size=20)
rising = st.lists(st.floats(0.0, 1.0), min_size=2, max_size=8, unique=True).map(sorted)


@given(
    excluded=st.frozensets(name, max_size=4),
    spots=st.dictionaries(st.sampled_from([0, 1, 2]), st.tuples(coordinate, coordinate)),
    balls=st.dictionaries(
        name, st.builds(PlacedCircle, coordinate, coordinate, st.floats(0.1, 1e3)), max_size=3
    ),
    curve=rising,
)
def test_decisions_are_read_back_as_they_were_written(
    tmp_path_factory, excluded, spots, balls, curve
):
    folder = tmp_path_factory.mktemp("session")
    nodes = tuple((c, c) for c in curve)
    decisions = Decisions(excluded, spots, balls, {1: nodes})
    write_decisions(decisions, folder)
    assert read_decisions(folder) == decisions


@pytest.mark.parametrize(
    "text",
    [
        "not toml = = =",
        'format = "gelpolight-decisions"\nversion = 1\n[balls_px]\n"a.png" = [1.0, 2.0]',
        'format = "gelpolight-decisions"\nversion = 1\n[balls_px]\n"a.png" = [1.0, 2.0, -3.0]',
        'format = "gelpolight-decisions"\nversion = 1\n[mirror_spots_px]\ngold = [1.0, 2.0]',
        'format = "gelpolight-decisions"\nversion = 1\n[mirror_spots_px]\nred = [nan, 2.0]',
        'format = "gelpolight-decisions"\nversion = 1\n[reflectance_nodes]\n'
        "red = [[0.5, 0.4], [0.4, 0.6]]",
        'format = "something else"\nversion = 1',
        "version = 1",
    ],
)
def test_damaged_decisions_are_refused_with_advice(tmp_path, text):
    (tmp_path / "decisions.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"decisions\.toml.*cannot be used"):
        read_decisions(tmp_path)


def test_decisions_of_a_newer_program_are_not_half_read(tmp_path):
    (tmp_path / "decisions.toml").write_text(
        'format = "gelpolight-decisions"\nversion = 2\n', encoding="utf-8"
    )
    with pytest.raises(InputError, match="newer version of GelPoLight Studio"):
        read_decisions(tmp_path)
