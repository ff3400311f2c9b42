"""A validation is of other images than its calibration, and says what would decide it."""

import hashlib

import pytest

from gelpolight_core.base.compared_quantity import REFERENCE, REST, Quantity
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Verdict
from gelpolight_core.lab.validation_trial import refuse_source
from gelpolight_core.session.validation import BALLS, SMALLER, Validation


@pytest.mark.function("Refuse a press for the validation that the calibration was made from")
def test_an_image_of_the_calibration_is_refused_by_its_content(tmp_path):
    image = tmp_path / "renamed.png"
    image.write_bytes(b"a press")
    refuse_source(image, {"0" * 64})
    with pytest.raises(InputError, match="used for the calibration"):
        refuse_source(image, {hashlib.sha256(b"a press").hexdigest()})


@pytest.mark.function("Read what would decide a validation that is not decidable")
@pytest.mark.parametrize(
    ("name", "parts", "truth_sd", "action"),
    [
        ("height", {"calibration": 0.028}, 0.001, BALLS),
        ("diameter", {"calibration": 0.028}, 0.001, SMALLER["calibration"]),
        ("height", {"calibration": 0.005}, 0.04, SMALLER[REFERENCE]),
        ("height", {"calibration": 0.005}, None, SMALLER[REST]),
        ("height", {"model": 0.028}, None, "model and mode. A tolerance"),
    ],
)
def test_what_decides_names_the_largest_part_and_a_tolerance_that_is_enough(
    name, parts, truth_sd, action
):
    pair = Quantity(name, 1.01, 0.029, 1.0, 5.0, truth_sd, tuple(parts.items()))
    decided = Quantity("side", 4.0, 0.001, 4.0, 5.0)
    assert pair.verdict is Verdict.WARN
    sentence = Validation("id", "", "", "x", (decided, pair)).what_decides
    assert action in sentence
    enough = float(sentence.partition("A tolerance of ")[2].partition(" %")[0])
    judged = Quantity(name, 1.01, 0.029, 1.0, enough, truth_sd)
    assert judged.verdict is Verdict.PASS
    assert Quantity(name, 1.01, 0.029, 1.0, enough - 0.1, truth_sd).verdict is Verdict.WARN
    assert Validation("id", "", "", "x", (decided,)).what_decides == ""
