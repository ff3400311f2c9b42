"""The outputs for four sensors are those that were recorded; golden_outputs.py says how."""

import pytest
from golden_outputs import OF_SHARED, SESSIONS, differences, outputs


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.long] if n == "rendered" else []) for n in SESSIONS],
)
def test_the_outputs_are_those_that_were_recorded(name, tmp_path, request):
    if name in OF_SHARED:
        request.getfixturevalue("shared_data")  # skips with the reason where it is absent
    lines = differences(name, *outputs(name, tmp_path))
    assert not lines, "\n".join(lines)
