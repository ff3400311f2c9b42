"""A validation is of other images than its calibration, and says what would decide it."""

import hashlib
from dataclasses import replace

import pytest

from gelpolight_core.base.compared_quantity import REFERENCE, REST, Quantity
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Verdict
from gelpolight_core.calibration.manifest import CalibrationSummary
from gelpolight_core.lab.evaluation_run import refuse_source
from gelpolight_core.lab.measurement_record import FILE, MeasurementRecord
from gelpolight_core.lab.measurement_store import open_records
from gelpolight_core.lab.validation_trial import recorded_validation
from gelpolight_core.session.validation import BALLS, SMALLER, Validation


@pytest.mark.function("Refuse a press for the validation that the calibration was made from")
def test_an_image_of_the_calibration_is_refused_by_its_content(tmp_path):
    image = tmp_path / "renamed.png"
    image.write_bytes(b"a press")
    refuse_source(image, {"0" * 64})
    with pytest.raises(InputError, match="used for the calibration"):
        refuse_source(image, {hashlib.sha256(b"a press").hexdigest()})


def test_only_trusted_measurements_of_other_images_count_whether_they_conform_or_not(tmp_path):
    image, own = tmp_path / "press.png", tmp_path / "own.png"
    for file in (image, own):
        file.write_bytes(file.name.encode())
    sources = frozenset({hashlib.sha256(b"own.png").hexdigest()})
    calibration = CalibrationSummary("c1", "A", "full", *[""] * 5, (4, 3), {}, sources=sources)
    store = open_records(tmp_path / "records.sqlite")
    stated = Quantity("diameter_mm", 5.01, 0.01, 5.0, 1.0)
    far, unstated = replace(stated, value=6.0), replace(stated, truth=None)
    cases = (
        ("ball", unstated, "", image, "c1"),
        ("ball", stated, "doubtful", image, "c1"),
        ("ball", stated, "pass", own, "c1"),
        ("ball", stated, "pass", "", "c1"),  # a live image: it may be one of the calibration
        ("ball", stated, "pass", tmp_path / "gone.png", "c1"),
        ("distance", stated, "pass", image, "c1"),
        ("ball", stated, "pass", image, "another"),
    )
    for shape, quantity, verdict, file, identity in cases:
        settings = {FILE: str(file)} if file else {}
        store.add(MeasurementRecord("A", identity, shape, (quantity,), verdict, settings=settings))
    _, why = recorded_validation(store, calibration, (5.0, 8.0))
    counts = [int(part.split()[0]) for part in why.split(", ")]
    assert sum(counts) == len(cases) and len(counts) == 5, "each kind of reason once"
    for quantity in (stated, far):
        store.add(
            MeasurementRecord("A", "c1", "ball", (quantity,), "pass", settings={FILE: str(image)})
        )
    validation, _ = recorded_validation(store, calibration, (5.0, 8.0))
    assert [c.value for c in validation.comparisons] == [5.01, 6.0]
    assert {(c.name, c.limit_percent) for c in validation.comparisons} == {("diameter", 5.0)}
    assert validation.verdict is Verdict.FAIL and validation.identity == "c1"
    store.close()


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


@pytest.mark.function("Read how often and on how many objects a calibration was validated")
@pytest.mark.parametrize(
    ("objects", "names", "basis"),
    [
        ("Ball, 5 mm", ["diameter"], "1 press of 1 object"),
        ("Cylinder, 5 mm", ["diameter", "height"], "1 press of 1 object"),
        ("Cylinder, 5 mm", ["diameter", "height"] * 2, "2 presses of 1 object"),
        ("Cylinder, 5 mm; Cuboid, 4 mm", ["diameter", "height", "side"], "2 presses of 2 objects"),
    ],
)
def test_a_validation_counts_its_presses_and_objects(objects, names, basis):
    compared = tuple(Quantity(name, 5.0, 0.01, 5.0, 5.0) for name in names)
    assert Validation("id", "", "", objects, compared).basis == basis
