"""The shape of the undeformed membrane: against the equation of a sphere, and as it is stated."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from gelpolight_core.base.errors import InputError
from gelpolight_core.geometry.membrane_shape import FLAT, MembraneShape, height_field
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
    ],
)
def test_a_shape_that_cannot_be_is_refused(wrong):
    with pytest.raises(ValueError, match="membrane"):
        replace(CAP, **wrong).check()


def field_file(folder: Path, reach_mm: float) -> str:
    axis = np.linspace(-reach_mm, reach_mm, 81)
    points = np.stack(np.meshgrid(axis, axis), axis=-1)
    height = replace(CAP, axis_mm=(0.0, 0.0)).height(points)
    np.savez(folder / "membrane.npz", x_mm=axis, y_mm=axis, height_mm=height)
    return "membrane.npz"


def test_a_height_field_of_a_cap_is_the_cap(tmp_path):
    found = replace(height_field(tmp_path, field_file(tmp_path, 14.0), WIDTH_MM), axis_mm=AXIS)
    places = np.random.default_rng(3).uniform(-8.0, 8.0, (50, 2))
    np.testing.assert_allclose(found.height(places), CAP.height(places), atol=1e-5)
    np.testing.assert_allclose(found.normals(places), CAP.normals(places), atol=1e-4)


def cap_mesh(rings: int) -> trimesh.Trimesh:
    """Return the cap as a mesh out to its boundary."""
    angles = np.linspace(0.0, 2.0 * np.pi, 4 * rings, endpoint=False)
    out = np.linspace(0.0, 0.5 * WIDTH_MM, rings)[1:, None, None]
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    places = np.concatenate([np.zeros((1, 2)), (out * ring).reshape(-1, 2)])
    heights = replace(CAP, axis_mm=(0.0, 0.0)).height(places)
    points = np.column_stack([places, heights])
    return trimesh.Trimesh(points, Delaunay(places).simplices, process=False)


def test_a_mesh_of_a_cap_is_the_cap_also_as_a_solid_and_turned_over(tmp_path):
    mesh = cap_mesh(40)
    base = mesh.copy()
    base.vertices[:, 2] = 0.0
    base.invert()
    turned = mesh.copy()
    turned.invert()
    away = np.linspace(0.0, 0.49 * WIDTH_MM, 40)
    places = np.array(AXIS) + np.stack([away * np.cos(away), away * np.sin(away)], axis=-1)
    for name, shown in (("a.stl", mesh), ("b.STL", mesh + base), ("c.stl", turned)):
        shown.export(tmp_path / name, file_type="stl")
        found = replace(height_field(tmp_path, name, WIDTH_MM), axis_mm=AXIS)
        # Facets of 0.3 mm: a chord of the sphere is a quarter of a micron off its arc.
        np.testing.assert_allclose(found.height(places), CAP.height(places), atol=2e-3)
        np.testing.assert_allclose(found.slopes(places), CAP.slopes(places), atol=1e-2)
    with pytest.raises(InputError, match="cover"):
        height_field(tmp_path, "a.stl", 1.1 * WIDTH_MM)


@pytest.mark.parametrize("content", [b"", b"rubbish", b"solid a\nendsolid a\n", bytes(84)])
def test_a_mesh_that_cannot_be_used_is_refused(tmp_path, content):
    (tmp_path / "membrane.stl").write_bytes(content)
    with pytest.raises(InputError, match=r"membrane\.stl"):
        height_field(tmp_path, "membrane.stl", WIDTH_MM)


@pytest.mark.parametrize("content", [None, b"not an archive", 9.0])
def test_a_height_field_that_cannot_be_used_is_refused(tmp_path, content):
    if isinstance(content, bytes):
        (tmp_path / "membrane.npz").write_bytes(content)
    elif content is not None:
        field_file(tmp_path, content)
    with pytest.raises(InputError, match=r"membrane\.npz"):
        height_field(tmp_path, "membrane.npz", WIDTH_MM)


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
    by_file = f'\n[membrane]\nshape = "height_field"\nfile = "{field_file(tmp_path, 14.0)}"\n'
    session = read_session(described(tmp_path, by_file, small_session))
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
