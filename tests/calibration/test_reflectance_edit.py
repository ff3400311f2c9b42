"""A reflectance curve edited by hand: what it changes, and what it must not change."""

import numpy as np
import pytest
import scene
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
from gelpolight_core.calibration.reflectance_edit import with_edited_curves
from gelpolight_core.light.membrane_brdf import MembraneBrdf
from gelpolight_core.light.reflectance_table import ReflectanceTable
from gelpolight_core.sensor.sensor_calibration import Calibration

Array = NDArray[np.float64]
NODES = np.linspace(0.0, 1.0, 9)
BENT = 1.2 * NODES**1.3 + 0.02
WHEN = "2026-05-06T07:08:09+00:00"
MEMBRANE = MembraneBrdf(1.02, 0.2, 0.5, 0.3)


def drawn(calibration: Calibration, **more: str) -> Calibration:
    """Return the calibration with the green curve bent."""
    return with_edited_curves(
        calibration, {1: (NODES, BENT)}, operator="a technician", made=WHEN, **more
    )


def membrane_of(calibration: Calibration) -> MembraneBrdf:
    return calibration.data.full.membrane


def test_the_papers_model_uses_the_curve_as_it_is_drawn():
    plain, after = scene.calibration(), drawn(scene.full_calibration(MEMBRANE))
    np.testing.assert_array_equal(after.data.reflectance.values[1], BENT)
    np.testing.assert_array_equal(after.data.reflectance.cosines[1], NODES)
    for k in (0, 2):
        np.testing.assert_array_equal(
            after.data.reflectance.values[k], plain.data.reflectance.values[k]
        )


def test_the_full_models_diffuse_share_changes_as_the_curve_did():
    before = membrane_of(scene.full_calibration(MEMBRANE))
    after = membrane_of(drawn(scene.full_calibration(MEMBRANE)))
    cosine = np.linspace(0.05, 1.0, 50)
    share = after.diffuse_share(np.repeat(cosine[:, None], 3, axis=1))
    old = before.diffuse_share(np.repeat(cosine[:, None], 3, axis=1))
    change = ReflectanceTable((NODES,) * 3, (BENT,) * 3, np.zeros((3, 2))).response(1, cosine)
    ratio = share[:, 1] / old[:, 1] / (change / cosine)
    # Except for its height, which cancels in the comparison with the bare membrane.
    assert np.ptp(ratio) / ratio.mean() < 2e-3
    for k in (0, 2):
        np.testing.assert_allclose(share[:, k], old[:, k], atol=2e-5)
    assert (after.gloss, after.roughness, after.interreflection) == (0.2, 0.5, 0.3)


def test_what_was_changed_is_on_record_and_in_the_file(tmp_path):
    before = scene.full_calibration(MEMBRANE)
    after = drawn(before)
    assert after.identity != before.identity
    (edit,) = after.provenance.edits
    assert (edit.part, edit.channels) == ("reflectance", ("green",))
    assert (edit.operator, edit.made) == ("a technician", WHEN)
    write_calibration(after, tmp_path / "edited.gplcal")
    read = read_calibration(tmp_path / "edited.gplcal")
    assert read.provenance.edits == after.provenance.edits
    assert membrane_of(read) == membrane_of(after)
    assert read.identity == after.identity


def test_an_undone_edit_gives_nearly_the_old_membrane():
    before = scene.full_calibration(MEMBRANE)
    table = before.data.reflectance
    back = with_edited_curves(
        drawn(before), {1: (table.cosines[1], table.values[1])}, operator="x", made=WHEN
    )
    even = np.repeat(np.linspace(0.02, 1.0, 200)[:, None], 3, axis=1)
    np.testing.assert_allclose(
        membrane_of(back).diffuse_share(even), membrane_of(before).diffuse_share(even), atol=1e-4
    )
    np.testing.assert_allclose(back.data.factors, before.data.factors, rtol=1e-5)
    assert len(back.provenance.edits) == 2


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(0.001, 1.0), min_size=3, max_size=12), st.floats(0.0, 0.2))
def test_whatever_is_drawn_the_membrane_keeps_growing_brighter(steps, floor):
    values = floor + np.cumsum([0.0, *steps])
    nodes = np.linspace(0.0, 1.0, values.size)
    after = with_edited_curves(
        scene.full_calibration(MEMBRANE), {0: (nodes, values)}, operator="x", made=WHEN
    )
    curves = membrane_of(after).curves
    assert (np.diff(curves, axis=1) > 0.0).all()
    assert np.isfinite(curves).all()
    assert (after.data.factors >= 0.0).all()


@pytest.mark.parametrize(
    ("nodes", "values"),
    [
        ([0.0, 0.5, 1.0], [0.0, 0.6, 0.6]),
        ([0.0, 0.5, 1.0], [0.0, 0.6, 0.5]),
        ([0.0, 0.5, 0.5, 1.0], [0.0, 0.2, 0.3, 1.0]),
        ([0.1, 1.0], [0.0, 1.0]),
        ([0.0, 0.9], [0.0, 1.0]),
        ([0.0, 1.0], [-0.1, 1.0]),
        ([0.0, 1.0], [0.0, np.nan]),
        ([0.0, 1.0], [0.0, 0.5, 1.0]),
        ([0.0], [1.0]),
    ],
)
def test_a_curve_that_cannot_be_inverted_is_refused(nodes, values):
    curve = (np.array(nodes), np.array(values))
    with pytest.raises(InputError, match="green"):
        with_edited_curves(scene.full_calibration(MEMBRANE), {1: curve}, operator="x", made=WHEN)
