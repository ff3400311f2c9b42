"""The full model in the calibration file: nothing is lost, everything is checked."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scene

from gelpolight_core.calibration.file import MANIFEST, read_calibration, write_calibration
from gelpolight_core.errors import InputError
from gelpolight_core.reflectance.membrane import CURVE_NODES, Membrane
from gelpolight_core.sensor_calibration import Calibration, FullModel, ScaleSd

CURVES = tuple(tuple((np.linspace(0.0, 1.0, CURVE_NODES) ** n).tolist()) for n in (1.0, 1.1, 0.9))


def full_calibration() -> Calibration:
    """Return the small sensor's calibration with a full model of unusual numbers."""
    plain = scene.calibration()
    full = FullModel(
        led_positions_mm=plain.data.led_positions_mm + np.array([0.1, -0.03, -0.2]),
        led_sd_mm=np.array([[0.01, 0.02, 0.05], [0.015, 0.01, 0.04], [0.01, 0.01, 0.06]]),
        membrane=Membrane(1.03, 0.21, 0.47, 0.31, CURVES),
        background=(0.9 * plain.data.radiance).astype(np.float32),
        decay_mm=0.68,
        misfit=0.0123,
        held_out=(0.031, 0.0134),
        kept="refined",
        membrane_sd={"exponent": 0.0, "gloss": 0.012},
        membrane_held_out=(0.0134, 0.0129),
        membrane_kept="one-dimensional",
        scale_sd=ScaleSd(depth=0.0061, lateral=0.0002),
    )
    return replace(plain, model="full").changed(full=full)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a valid file of a full model."""
    path = tmp_path_factory.mktemp("full") / "good.gplcal"
    write_calibration(full_calibration(), path)
    return path


def forged(
    whole: Path,
    target: Path,
    change: Callable[[dict[str, Any]], None] = lambda manifest: None,
    **arrays: np.ndarray,
) -> Path:
    """Return a copy with other values and recomputed checksums, as a forger would make it."""
    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(target, "w") as new:
        manifest = json.loads(old.read(MANIFEST))
        data = {name: old.read(name) for name in old.namelist()}
        for name, array in arrays.items():
            stream = io.BytesIO()
            np.save(stream, array)
            data[f"{name}.npy"] = stream.getvalue()
            manifest["arrays"][name] = {
                "shape": list(array.shape),
                "kind": array.dtype.str,
                "sha256": hashlib.sha256(stream.getvalue()).hexdigest(),
            }
        change(manifest)
        data[MANIFEST] = json.dumps(manifest).encode()
        data[f"{MANIFEST}.sha256"] = hashlib.sha256(data[MANIFEST]).hexdigest().encode()
        for name, content in data.items():
            new.writestr(name, content)
    return target


def test_the_full_model_comes_back(whole: Path) -> None:
    before, after = full_calibration(), read_calibration(whole)
    assert before.data.full is not None
    assert after.data.full is not None
    assert after.model == "full"
    assert after.identity == before.identity
    assert after.data.full.membrane == before.data.full.membrane
    for name in (
        "decay_mm",
        "misfit",
        "held_out",
        "kept",
        "membrane_sd",
        "membrane_held_out",
        "membrane_kept",
        "scale_sd",
    ):
        assert getattr(after.data.full, name) == getattr(before.data.full, name)
    for name in ("led_positions_mm", "led_sd_mm", "background"):
        np.testing.assert_array_equal(
            getattr(after.data.full, name), getattr(before.data.full, name)
        )
    assert after.data.full.background.dtype == np.float32


OLDER = Path(__file__).parents[1] / "data/2026-11-25/workspace/sensors/small-1/first.gplcal"
"""A file of version 4, which was not yet laid out as the dataclasses are."""


def test_a_full_model_of_version_1_is_read(tmp_path: Path) -> None:
    """Version 1 had no curves, no membrane deviations and no choice between membranes."""

    def older(manifest: dict[str, Any]) -> None:
        manifest["version"] = 1
        del manifest["provenance"]["edits"]
        for key in ("membrane_sd", "membrane_held_out", "membrane_kept"):
            del manifest["full"][key]
        # The share of a neighbourhood's light was the membrane's reflectance, too.
        manifest["full"]["membrane"]["bounce_reach_mm"] = 1.0
        manifest["full"]["membrane"]["bounce"] = manifest["full"]["membrane"].pop("interreflection")

    read = read_calibration(forged(OLDER, tmp_path / "old.gplcal", older))
    assert read.data.full.membrane == read_calibration(OLDER).data.full.membrane
    assert read.data.full.membrane_kept == "two-lobe"
    assert read.provenance.edits == ()


@pytest.mark.parametrize("spoil", ["falling", "nan", "dark", "short", "negative"])
def test_curves_that_no_membrane_has_are_refused(whole: Path, tmp_path: Path, spoil: str) -> None:
    curves = np.array(CURVES)
    if spoil == "falling":
        curves[1, 100] = curves[1, 90]
    elif spoil == "nan":
        curves[0, 3] = np.nan
    elif spoil == "dark":
        curves[2] = 0.0
    elif spoil == "short":
        curves = curves[:, ::2].copy()
    else:
        curves -= 0.1

    def change(manifest: dict[str, Any]) -> None:
        manifest["data"]["full"]["membrane"]["diffuse"] = curves.tolist()

    refused(forged(whole, tmp_path / "f.gplcal", change))


def refused(path: Path) -> None:
    """Refuse a file for one of its values, not only because its identity does not follow."""
    with pytest.raises(InputError) as refusal:
        read_calibration(path)
    assert "identity" not in refusal.value.found


def test_the_same_images_have_the_same_identity_for_any_operator_and_time() -> None:
    one = full_calibration()
    later = replace(one.provenance, created="2031-01-01T00:00:00+00:00", operator="another")
    assert replace(one, provenance=later).identity == one.identity


def test_every_part_of_the_full_model_changes_the_identity() -> None:
    whole = full_calibration()
    assert whole.data.full is not None
    others = [
        replace(whole.data.full, membrane=replace(whole.data.full.membrane, gloss=0.22)),
        replace(whole.data.full, led_positions_mm=whole.data.full.led_positions_mm + 1e-6),
        replace(whole.data.full, background=whole.data.full.background * np.float32(1.001)),
        None,
    ]
    names = {whole.changed(full=full).identity for full in others}
    assert len(names | {whole.identity}) == 5


def test_a_file_from_before_lengths_had_a_deviation_is_read(tmp_path: Path) -> None:
    def drop(manifest: dict[str, Any]) -> None:
        del manifest["full"]["scale_sd"]

    old = read_calibration(forged(OLDER, tmp_path / "old.gplcal", drop))
    assert old.data.full.scale_sd is None
    assert old.identity == read_calibration(OLDER).identity


def test_a_file_without_full_model_reads_as_the_papers(tmp_path: Path) -> None:
    write_calibration(scene.calibration(), tmp_path / "paper.gplcal")
    assert read_calibration(tmp_path / "paper.gplcal").data.full is None


def test_interreflection_of_an_older_file_makes_heights_less_certain(tmp_path: Path) -> None:
    def older(manifest: dict[str, Any]) -> None:
        manifest["full"]["membrane"]["bounce_reach_mm"] = 1.0
        manifest["full"]["membrane"]["interreflection"] = 0.3

    def today(manifest: dict[str, Any]) -> None:
        manifest["full"]["membrane"]["interreflection"] = 0.3

    now, read = (
        read_calibration(forged(OLDER, tmp_path / "o.gplcal", change)).data.full
        for change in (today, older)
    )
    assert read.membrane == now.membrane
    assert read.scale_sd.depth == pytest.approx(np.hypot(now.scale_sd.depth, 0.03))


def spoilt(array: np.ndarray, value: float) -> np.ndarray:
    copy = np.array(array)
    copy.flat[copy.size // 2] = value
    return copy


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ["led_positions_mm", "led_sd_mm", "background"])
def test_arrays_that_are_not_finite_are_refused(
    whole: Path, tmp_path: Path, name: str, value: float
) -> None:
    good = getattr(full_calibration().data.full, name)
    arrays = {f"data.full.{name}": spoilt(good, value)}
    with pytest.raises(InputError, match=f"full.{name}"):
        read_calibration(forged(whole, tmp_path / "f.gplcal", **arrays))


@pytest.mark.parametrize(
    "entry",
    [
        {"kept": "guess"},
        {"decay_mm": -1.0},
        {"misfit": -0.1},
        {"held_out": [float("nan"), 1.0]},
        {"membrane": {"interreflection": -1.0}},
        {"membrane": {"bounce_reach_mm": 0.0}},
        {"membrane_kept": "velvet"},
        {"membrane_sd": {"gloss": -0.1}},
        {"membrane_held_out": [0.1]},
        {"scale_sd": {"depth": -0.01, "lateral": 0.0}},
        {"scale_sd": {"depth": 0.01, "lateral": float("nan")}},
        {"scale_sd": {"depth": 0.01}},
        {"scale_sd": 0.01},
    ],
    ids=str,
)
def test_values_without_meaning_are_refused(
    whole: Path, tmp_path: Path, entry: dict[str, Any]
) -> None:
    def change(manifest: dict[str, Any]) -> None:
        full = manifest["data"]["full"]
        full.update({**entry, "membrane": {**full["membrane"], **entry.get("membrane", {})}})

    refused(forged(whole, tmp_path / "f.gplcal", change))


@pytest.mark.parametrize("led_height_mm", [138.0, 13.8])
def test_a_forged_file_keeps_no_identity(whole: Path, tmp_path: Path, led_height_mm: float) -> None:
    def change(manifest: dict[str, Any]) -> None:
        manifest["data"]["sensor"]["led_height_mm"] = led_height_mm

    with pytest.raises(InputError, match="identity"):
        read_calibration(forged(whole, tmp_path / "f.gplcal", change))


def test_a_forged_older_file_gets_another_identity(tmp_path: Path) -> None:
    def change(manifest: dict[str, Any]) -> None:
        manifest["sensor"]["led_height_mm"] += 0.1

    forged_one = read_calibration(forged(OLDER, tmp_path / "f.gplcal", change))
    assert forged_one.identity != read_calibration(OLDER).identity
