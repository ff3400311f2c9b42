"""Texts in a calibration file are shown in the language of the reader."""

import json
from dataclasses import replace

import pytest

from gelpolight_core.calibration.file import read_calibration, write_calibration
from gelpolight_core.calibration.manifest import read_quality
from gelpolight_core.finding import Verdict
from gelpolight_core.translation import Text, current_language, tr, use_language


@pytest.fixture(autouse=True)
def _same_language():
    before = current_language()
    use_language("en")
    yield
    use_language(before)


def test_every_text_of_a_calibration_file_can_be_translated(small_calibration, tmp_path):
    """Also the advice that the technician needs when a figure fails; with values it is English."""
    quality = small_calibration.quality
    for table in quality.values():
        for figure in table.figures:
            for text in (figure.text, figure.remedy):
                assert isinstance(text, Text) or not text, (figure.key, text)
    # A figure that fails shows its advice.
    lens = replace(
        quality["lens"],
        figures=tuple(replace(f, verdict=Verdict.FAIL) for f in quality["lens"].figures),
    )
    path = tmp_path / "a.gplcal"
    write_calibration(replace(small_calibration, quality={**quality, "lens": lens}), path)
    english = read_calibration(path).quality["lens"]
    assert english == lens
    use_language("de")
    german = read_calibration(path).quality["lens"]
    for one, other in zip(english.figures, german.figures, strict=True):
        assert (one.key, one.value) == (other.key, other.value)
        assert one.text != other.text
        assert one.remedy != other.remedy or not one.remedy or one.key == "views_left_out"


def test_plain_texts_of_older_files_are_read(small_calibration):
    rows = json.loads(json.dumps(small_calibration.quality["lens"].as_rows()))
    assert read_quality(rows) == small_calibration.quality["lens"]
    use_language("de")
    assert read_quality(rows).figures[0].text == tr(rows[0]["label"])
