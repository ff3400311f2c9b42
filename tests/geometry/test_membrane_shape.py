"""The shape of the undeformed membrane: against the equation of a sphere, and as it is stated."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gelpolight_core.base.errors import InputError
from gelpolight_core.geometry.membrane_shape import FLAT, MembraneShape
from gelpolight_core.session.description import write_description
from gelpolight_core.session.session import read_session

APEX_MM, WIDTH_MM = 2.0, 26.0
RADIUS_MM = ((WIDTH_MM / 2.0) ** 2 + APEX_MM**2) / (2.0 * APEX_MM)
AXIS = (0.3, -0.7)
CAP = MembraneShape("spherical_cap", APEX_MM, WIDTH_MM, AXIS)
MIDDLE = np.array([*AXIS, APEX_MM - RADIUS_MM])

inside = st.tuples(st.floats(-8.0, 8.0), st.floats(-8.0, 8.0))


@given(inside)
def test_a_cap_is_part_of_a_sphere_with_its_normals(place):
    point = CAP.points(np.array(place))
    assert np.linalg.norm(point - MIDDLE) == pytest.approx(RADIUS_MM, abs=1e-9)
    # Towards the camera, into the sphere.
    inwards = (MIDDLE - point) / RADIUS_MM
    np.testing.assert_allclose(CAP.normals(np.array(place)), inwards, atol=1e-7)


@given(inside, st.floats(-2.0, 4.0))
def test_rays_and_normals_meet_even_a_high_dome(place, above):
    dome = MembraneShape("spherical_cap", 5.0, WIDTH_MM, AXIS)
    foot, rays = np.array([place]), -np.array([place]) / 38.0
    met = dome.points(dome.met_by(foot, rays))[0]
    np.testing.assert_allclose(met[:2], foot[0] - met[2] * rays[0], atol=1e-8)
    # The nearest point of a sphere is on the line from its middle.
    radius = ((WIDTH_MM / 2.0) ** 2 + 25.0) / 10.0
    middle = np.array([*AXIS, 5.0 - radius])
    point = dome.points(np.array(place))
    out = (point - middle) / radius
    found = dome.nearest(point + above * out)
    np.testing.assert_allclose(found, place, atol=1e-5)


def test_a_cap_ends_on_the_plane_of_its_boundary_and_a_mould_may_be_off():
    rim = np.array([[13.0, 0.0], [0.0, -13.0]]) + AXIS
    np.testing.assert_allclose(CAP.height(rim), 0.0, atol=1e-12)
    higher = replace(CAP, rise_mm=0.05)
    np.testing.assert_allclose(higher.height(rim), 0.0, atol=1e-12)
    assert float(higher.height(np.array(AXIS))) == pytest.approx(APEX_MM + 0.05)
    # To first order, a risen cap is a higher cap.
    other, place = replace(CAP, apex_height_mm=APEX_MM + 0.05), np.array([5.0, 3.0])
    assert float(higher.height(place)) == pytest.approx(float(other.height(place)), abs=1e-3)


@pytest.mark.parametrize(
    "wrong",
    [
        {"shape": "pyramid"},
        {"apex_height_mm": 14.0},
        {"diameter_mm": 0.0},
        {"apex_height_mm": float("nan")},
        {"shape": "height_field"},
        {"shape": "height_field", "heights_mm": (*4 * ((0.0,) * 5,), (0.0,) * 4)},
    ],
)
def test_a_shape_that_cannot_be_is_refused(wrong):
    with pytest.raises(ValueError, match="membrane"):
        replace(CAP, **wrong).check()


def described(folder: Path, membrane: str, small_session: Path) -> Path:
    text = (small_session / "session.toml").read_text()
    (folder / "session.toml").write_text(text + membrane)
    return folder


def test_a_session_keeps_the_membrane_that_it_states(tmp_path, small_session):
    assert read_session(small_session).surface == FLAT
    stated = '\n[membrane]\nshape = "spherical_cap"\napex_height_mm = 1.75\n'
    session = read_session(described(tmp_path, stated, small_session))
    assert session.surface == MembraneShape(
        "spherical_cap", 1.75, session.sensor.working_diameter_mm
    )
    write_description(session)
    assert read_session(tmp_path).surface == session.surface


@pytest.mark.parametrize(
    ("membrane", "key"),
    [
        ('shape = "pyramid"', "shape"),
        ('shape = "spherical_cap"\napex_height_mm = 40.0', "apex_height_mm"),
        ('shape = "spherical_cap"\nheight = 1.0', "height"),
        ("apex_height_mm = 1.0", "shape"),
        ('shape = "spherical_cap"', "apex_height_mm"),
        ('shape = "height_field"', "file"),
        ('shape = "height_field"\nfile = "../membrane.npz"', "file"),
    ],
)
def test_a_wrong_entry_of_the_membrane_is_named(tmp_path, small_session, membrane, key):
    folder = described(tmp_path, f"\n[membrane]\n{membrane}\n", small_session)
    with pytest.raises(InputError, match=rf"\[membrane\] {key}"):
        read_session(folder)
