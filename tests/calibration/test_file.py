"""The calibration file: nothing is lost, nothing is half-read, everything is checked."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
import scene
from hypothesis import given, settings
from hypothesis import strategies as st

from gelpolight_core.calibration.file import MANIFEST, read_calibration, write_calibration
from gelpolight_core.errors import InputError


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a valid calibration file."""
    path = tmp_path_factory.mktemp("calibration") / "good.gplcal"
    write_calibration(scene.calibration(), path)
    return path


def test_every_number_comes_back(whole: Path) -> None:
    before, after = scene.calibration(), read_calibration(whole)
    assert after.identity == before.identity
    assert (after.data.sensor, after.camera, after.data.plane) == (
        before.data.sensor,
        before.camera,
        before.data.plane,
    )
    assert after.quality == before.quality
    assert after.provenance == before.provenance
    np.testing.assert_array_equal(after.data.radiance, before.data.radiance)
    np.testing.assert_array_equal(after.data.factors, before.data.factors)
    np.testing.assert_array_equal(after.data.led_positions_mm, before.data.led_positions_mm)
    np.testing.assert_array_equal(after.table.u_px, before.table.u_px)
    assert after.data.radiance.dtype == np.float32


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_a_truncated_or_altered_file_is_refused_or_the_same(
    whole: Path, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
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
        assert read.identity == scene.calibration().identity


def rewritten(whole: Path, target: Path, change: dict[str, object]) -> Path:
    """Return a forged copy with a changed manifest and a recomputed checksum."""
    import hashlib

    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(target, "w") as new:
        manifest = json.loads(old.read(MANIFEST))
        for key, value in change.items():
            table = manifest["data"] if key.startswith("data.") else manifest
            table[key.removeprefix("data.")] = value
        text = json.dumps(manifest).encode()
        for name in old.namelist():
            data = old.read(name)
            if name == MANIFEST:
                data = text
            elif name == f"{MANIFEST}.sha256":
                data = hashlib.sha256(text).hexdigest().encode()
            new.writestr(name, data)
    return target


def test_a_newer_version_is_refused_by_name(whole: Path, tmp_path: Path) -> None:
    path = rewritten(whole, tmp_path / "new.gplcal", {"version": 99})
    with pytest.raises(InputError, match="version 99"):
        read_calibration(path)


@pytest.mark.parametrize(
    "change",
    [
        {"model": "guess"},
        {"data.camera": {"width": 320}},
        {"data.plane": {"normal_camera": [0, 0, 5], "distance_mm": 39}},
        {"data.plane": {"normal_camera": [0, 0, 1], "distance_mm": 1e300}},
        {"data.sensor": None},
        {"data.unheard_of": 1.0},
        {"arrays": {}},
        {"arrays": {"radiance": {"shape": [10**6, 10**6, 3], "kind": "<f8", "sha256": ""}}},
        {"arrays": {"radiance": {"shape": [1], "kind": "|O", "sha256": ""}}},
        {"quality": [1, 2]},
    ],
)
def test_a_forged_manifest_is_refused(
    whole: Path, tmp_path: Path, change: dict[str, object]
) -> None:
    with pytest.raises(InputError) as refusal:
        read_calibration(rewritten(whole, tmp_path / "forged.gplcal", change))
    assert "identity" not in refusal.value.found


def test_the_blur_of_the_lens_comes_back_and_may_be_missing(tmp_path: Path) -> None:
    for blur_px in (None, 0.55):
        before = scene.calibration().changed(lens_blur_px=blur_px)
        write_calibration(before, tmp_path / "c.gplcal")
        after = read_calibration(tmp_path / "c.gplcal")
        assert after.data.lens_blur_px == blur_px
        assert after.identity == before.identity
