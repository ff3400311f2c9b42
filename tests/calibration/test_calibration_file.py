"""The calibration file: nothing is lost, nothing is half-read, everything is checked."""

import hashlib
import io
import json
import subprocess
import sys
import zipfile
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scene
from hypothesis import given, settings
from hypothesis import strategies as st

from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.calibration_file import (
    MANIFEST,
    read_calibration,
    write_calibration,
)
from gelpolight_core.calibration.manifest import read_summary, refuse_damaged_arrays
from gelpolight_core.image.bad_pixels import BadPixels
from gelpolight_core.image.grain import Grain, NoiseRatio
from gelpolight_core.image.response import gamma_response
from gelpolight_core.light.light_terms import LIGHT_TERMS
from gelpolight_core.light.membrane_brdf import MembraneBrdf
from gelpolight_core.sensor.sensor_calibration import Calibration

GONE = object()
TERMS = {
    "lobe_exponent": 1.6,
    **{f"lobe_axis_{axis}_{k}": 0.02 for axis in "xy" for k in CHANNEL_KEYS},
    **{f"absorption_per_mm_{k}": 0.004 for k in CHANNEL_KEYS},
    "stretch_loss": 0.12,
}
PART = {key: value for key, value in TERMS.items() if key != "lobe_axis_y_blue"}
OLDER = Path(__file__).parents[1] / "data/2026-11-25/workspace/sensors/small-1/first.gplcal"
"""A file of version 4, which was not yet laid out as the dataclasses are."""


def everything() -> Calibration:
    """Return a calibration that has all that a calibration may have."""
    full = scene.full_calibration(MembraneBrdf(1.03, 0.21, 0.47, 0.31, scene.CURVES, TERMS))
    bad = BadPixels(np.array([[3, 5], [3, 6]], np.int32), full.camera.height, full.camera.width)
    return full.changed(
        bad=bad,
        lens_blur_px=0.55,
        grain=Grain(0.98, 1e-6, 2e-6, 0.02, 0.03, NoiseRatio(0.97, -1e-7, 1e-8, 0.02)),
        response=gamma_response(2.2),
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return a valid file of a full model."""
    path = tmp_path_factory.mktemp("calibration") / "good.gplcal"
    write_calibration(everything(), path)
    return path


@pytest.mark.function("Save a calibration with every number, and read it again")
@pytest.mark.parametrize("make", [scene.calibration, everything])
def test_every_number_comes_back(make, tmp_path):
    before = make()
    write_calibration(before, tmp_path / "c.gplcal")
    after = read_calibration(tmp_path / "c.gplcal")
    np.testing.assert_equal(asdict(after.data), asdict(before.data))
    assert (after.model, after.quality) == (before.model, before.quality)
    assert after.provenance == before.provenance
    assert after.identity == before.identity
    assert after.data.radiance.dtype == np.float32


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_a_truncated_or_altered_file_is_refused_or_the_same(whole, tmp_path_factory, data):
    content = bytearray(whole.read_bytes())
    place = data.draw(st.integers(0, len(content) - 1))
    if data.draw(st.booleans()):
        content = content[:place]
    else:
        content[place] ^= data.draw(st.integers(1, 255))
    path = tmp_path_factory.mktemp("damaged") / "c.gplcal"
    path.write_bytes(content)
    try:
        read = read_calibration(path)
    except InputError as refusal:
        assert str(path) in str(refusal)
    else:
        assert read.identity == everything().identity


def forged(whole: Path, target: Path, change: dict[str, Any], **arrays: np.ndarray) -> Path:
    """Return a copy with other values and recomputed checksums, as a forger would make it."""
    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(target, "w") as new:
        data = {name: old.read(name) for name in old.namelist()}
        manifest = json.loads(data[MANIFEST])
        for name, array in arrays.items():
            stream = io.BytesIO()
            np.save(stream, array)
            data[f"{name}.npy"] = stream.getvalue()
            manifest["arrays"][name] = {
                "shape": list(array.shape),
                "kind": array.dtype.str,
                "sha256": hashlib.sha256(stream.getvalue()).hexdigest(),
            }
        for place, value in change.items():
            table = manifest
            *way, last = place.split("/")
            for key in way:
                table = table[key]
            table[last] = value
            if value is GONE:
                del table[last]
        data[MANIFEST] = json.dumps(manifest).encode()
        data[f"{MANIFEST}.sha256"] = hashlib.sha256(data[MANIFEST]).hexdigest().encode()
        for name, content in data.items():
            new.writestr(name, content)
    return target


NODES = np.array(scene.CURVES)
FALLING = NODES.copy()
FALLING[1, 100] = FALLING[1, 90]


@pytest.mark.parametrize(
    "change",
    [
        {"model": "guess"},
        {"data/camera": {"width": 320}},
        {"data/plane": {"normal_camera": [0, 0, 5], "distance_mm": 39}},
        {"data/plane": {"normal_camera": [0, 0, 1], "distance_mm": 1e300}},
        {"data/sensor": None},
        {"data/unheard_of": 1.0},
        {"arrays": {}},
        {"arrays": {"radiance": {"shape": [10**6, 10**6, 3], "kind": "<f8", "sha256": ""}}},
        {"arrays": {"radiance": {"shape": [1], "kind": "|O", "sha256": ""}}},
        {"quality": [1, 2]},
        {"data/full/kept": "guess"},
        {"data/full/decay_mm": -1.0},
        {"data/full/misfit": -0.1},
        {"data/full/worth": {"lobe": float("nan")}},
        {"data/full/worth": {"lobe": [1.0]}},
        {"data/full/worth": {"lobe": -0.1}},
        {"data/full/membrane/terms": {"stretch_loss": 1.5}},
        {"data/full/membrane/terms": {"stretch_loss": float("nan")}},
        {"data/full/membrane/terms": {**TERMS, "absorption_per_mm_red": -0.001}},
        {"data/full/membrane/terms": {**TERMS, "dispersion": 0.1}},
        {"data/full/membrane/terms": PART},
        {"data/full/membrane/interreflection": -1.0},
        {"data/full/membrane/bounce_reach_mm": 0.0},
        {"data/full/membrane_sd": {"gloss": -0.1}},
        {"data/full/scale_sd": {"depth": -0.01, "lateral": 0.0}},
        {"data/full/scale_sd": {"depth": 0.01, "lateral": float("nan")}},
        {"data/full/scale_sd": {"depth": 0.01}},
        {"data/full/scale_sd": 0.01},
        {"data/full/membrane/diffuse": FALLING.tolist()},
        {"data/full/membrane/diffuse": (NODES * np.nan).tolist()},
        {"data/full/membrane/diffuse": (NODES * [[1.0], [1.0], [0.0]]).tolist()},
        {"data/full/membrane/diffuse": NODES[:, ::2].tolist()},
        {"data/full/membrane/diffuse": (NODES - 0.1).tolist()},
    ],
    ids=lambda change: str(change)[:60],
)
def test_a_forged_value_without_meaning_is_refused(whole, tmp_path, change):
    """For the value itself, not only because the identity does not follow."""
    with pytest.raises(InputError) as refusal:
        read_calibration(forged(whole, tmp_path / "forged.gplcal", change))
    assert "identity" not in refusal.value.found


@pytest.mark.parametrize("name", ["led_positions_mm", "led_sd_mm", "background"])
def test_arrays_that_are_not_finite_are_refused(whole, tmp_path, name):
    for value in (np.nan, -np.inf):
        array = np.array(getattr(everything().data.full, name))
        array.flat[array.size // 2] = value
        with pytest.raises(InputError, match=f"full.{name}"):
            read_calibration(
                forged(whole, tmp_path / "f.gplcal", {}, **{f"data.full.{name}": array})
            )


def test_a_newer_version_and_a_forged_identity_are_refused(whole, tmp_path):
    path = tmp_path / "f.gplcal"
    for change, what in (({"version": 99}, "version 99"), ({LED_HEIGHT: 13.8}, "identity")):
        with pytest.raises(InputError, match=what):
            read_calibration(forged(whole, path, change))
    older = forged(OLDER, path, {LED_HEIGHT.removeprefix("data/"): 13.8})
    assert read_calibration(older).identity != read_calibration(OLDER).identity


LED_HEIGHT = "data/sensor/led_height_mm"


def test_a_full_model_of_version_1_is_read(tmp_path):
    """Version 1 had no curves, no membrane deviations and no choice of terms."""
    usual = read_calibration(OLDER).data.full
    older = {
        "version": 1,
        "provenance/edits": GONE,
        "full/membrane_sd": GONE,
        "full/membrane_held_out": GONE,
        "full/membrane_kept": GONE,
        # The share of a neighbourhood's light was the membrane's reflectance, too.
        "full/membrane/bounce_reach_mm": 1.0,
        "full/membrane/bounce": usual.membrane.interreflection,
        "full/membrane/interreflection": GONE,
    }
    read = read_calibration(forged(OLDER, tmp_path / "old.gplcal", older))
    assert read.data.full.membrane == usual.membrane
    assert read.data.full.membrane.terms == {}
    assert read.data.full.worth == {}
    assert read.provenance.edits == ()


@pytest.mark.function("Open calibrations of earlier programs")
def test_what_earlier_programs_chose_is_read_and_the_calibration_is_the_same(tmp_path):
    """They chose LEDs and membrane by held-out presses, and knew no terms of the light."""
    plain = scene.full_calibration()
    path = tmp_path / "now.gplcal"
    write_calibration(plain, path)
    older = {
        "data/full/held_out": [0.031, 0.0134],
        "data/full/membrane_held_out": [0.0134, 0.0129],
        "data/full/membrane_kept": "one-dimensional",
        "data/full/evidence": {"lobe": [3.0, 1.0]},
        "data/full/worth": GONE,
        "data/full/membrane/terms": GONE,
        "data/sensor/led_half_angle_deg": GONE,
    }
    read = read_calibration(forged(path, tmp_path / "older.gplcal", older))
    assert read.identity == plain.identity
    assert read.data.full.membrane == plain.data.full.membrane
    assert read.data.full.worth == {}
    before = read_calibration(OLDER)
    assert before.data.full.kept == "refined"
    assert before.identity == read_summary(OLDER).identity


def test_a_file_from_before_lengths_had_a_deviation_is_read(tmp_path):
    old = read_calibration(forged(OLDER, tmp_path / "old.gplcal", {"full/scale_sd": GONE}))
    assert old.data.full.scale_sd is None
    assert old.identity == read_calibration(OLDER).identity


def test_interreflection_of_an_older_file_makes_heights_less_certain(tmp_path):
    today = {"full/membrane/interreflection": 0.3}
    now, read = (
        read_calibration(forged(OLDER, tmp_path / "o.gplcal", change)).data.full
        for change in (today, today | {"full/membrane/bounce_reach_mm": 1.0})
    )
    assert read.membrane == now.membrane
    assert read.scale_sd.depth == pytest.approx(np.hypot(now.scale_sd.depth, 0.03))


KEYS = [term.parameters[0].full_key for term in LIGHT_TERMS]


def without(membrane: MembraneBrdf, key: str) -> MembraneBrdf:
    """Return a membrane without a term, which has a parameter of this name."""
    (term,) = (t for t in LIGHT_TERMS if key in [p.full_key for p in t.parameters])
    own = {p.full_key for p in term.parameters}
    return replace(membrane, terms={k: v for k, v in membrane.terms.items() if k not in own})


def test_the_identity_is_that_of_the_numbers_and_not_of_operator_and_time():
    one = everything()
    full = one.data.full
    later = replace(one.provenance, created="2031-01-01T00:00:00+00:00", operator="another")
    assert replace(one, provenance=later).identity == one.identity
    others = [
        one.changed(response=None),
        one.changed(bad=None),
        one.changed(full=None),
        one.changed(full=replace(full, membrane=replace(full.membrane, gloss=0.22))),
        *(one.changed(full=replace(full, membrane=without(full.membrane, k))) for k in KEYS),
        one.changed(full=replace(full, led_positions_mm=full.led_positions_mm + 1e-6)),
        one.changed(full=replace(full, background=full.background * np.float32(1.001))),
    ]
    assert len({other.identity for other in (one, *others)}) == 1 + len(others)


def test_the_summary_says_what_the_calibration_says(whole):
    """The sensor library reads only manifests."""
    summary, calibration = read_summary(whole), everything()
    assert summary.identity == calibration.identity
    assert summary.serial == calibration.serial
    assert summary.model == calibration.model
    assert summary.created == calibration.provenance.created
    assert summary.quality == calibration.quality
    assert summary.verdict is calibration.verdict
    assert summary.image_size == (calibration.camera.width, calibration.camera.height)


def test_a_list_of_calibrations_loads_no_numerical_library():
    """The window opens before the libraries are loaded."""
    program = (
        "import sys, app.program.workspace;"
        "print([m for m in ('scipy', 'numba', 'cv2', 'numpy') if m in sys.modules])"
    )
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=root, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_a_damaged_array_is_found_before_it_is_copied(whole, tmp_path):
    refuse_damaged_arrays(whole)
    path = forged(whole, tmp_path / "d.gplcal", {"arrays/data.crosstalk/sha256": "0" * 64})
    with pytest.raises(InputError, match="crosstalk"):
        refuse_damaged_arrays(path)
