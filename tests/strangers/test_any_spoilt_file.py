"""Whatever is done to a file, its reader gives a good result or one sentence."""

import fuzz
import pytest
from fuzz_kinds import all_kinds
from hypothesis import given, settings
from hypothesis import strategies as st

NAMES = (
    "calibration", "recording", "PNG image", "TIFF image", "jpg image", "bmp image",
    "webp image", "records", "true depth", "height map",
    "label", "session",
    "decisions", "design", "truth", "indenters", "validation",
    "workspace", "catalog", "annotations", "settings",
)  # fmt: skip


@pytest.fixture(scope="module")
def kinds(tmp_path_factory):
    return {kind.name: kind for kind in all_kinds(tmp_path_factory.mktemp("seeds"))}


def test_every_kind_is_tried(kinds):
    assert tuple(kinds) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_a_good_file_is_read(kinds, tmp_path, name):
    for seed in kinds[name].seeds[:6]:
        assert fuzz.try_one(kinds[name], seed, tmp_path / "in") == "good"


@pytest.mark.function("Open a damaged or forged file safely")
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", NAMES)
@settings(deadline=None, max_examples=25)
@given(number=st.integers(0, 10**9))
def test_a_spoilt_file_is_read_or_refused_in_a_sentence(kinds, tmp_path_factory, name, number):
    kind = kinds[name]
    folder = tmp_path_factory.getbasetemp() / "spoilt"
    assert fuzz.try_one(kind, fuzz.spoilt_input(kind, 1, number), folder) in ("good", "refused")
