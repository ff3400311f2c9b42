"""Round lengths and their text form."""

from hypothesis import given
from hypothesis import strategies as st

from app.widgets.units import length_text, round_length_mm, round_up


@given(st.floats(1e-4, 1e3))
def test_a_length_is_rounded_to_the_nearest_round_ones(length_mm):
    below, above = round_length_mm(length_mm), round_up(length_mm)
    assert 0.39 * length_mm < below <= length_mm * (1.0 + 1e-6)
    assert length_mm * (1.0 - 1e-6) <= above < 2.51 * length_mm
    for rounded in (below, above):
        assert f"{rounded:.3e}"[:5] in ("1.000", "2.000", "5.000")


def test_short_lengths_are_written_in_micrometres():
    assert length_text(0.05) == "50 µm"
    assert length_text(5.0) == "5 mm"
