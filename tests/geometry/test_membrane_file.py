"""A membrane that is given as a file: against the same membrane in closed form."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import Delaunay

from gelpolight_core.base.codec import pack, unpack
from gelpolight_core.base.errors import InputError
from gelpolight_core.geometry.membrane_file import height_field
from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.light.directions import light_directions
from gelpolight_core.session.description import write_description
from gelpolight_core.session.session import read_session
from gelpolight_core.stages.balls.ball_geometry import BallPose
from gelpolight_core.stages.balls.draped_ball import draped_ball

WIDTH_MM = 26.0
RIM_MM = 0.5 * WIDTH_MM
CAP = MembraneShape("spherical_cap", 2.0, WIDTH_MM)
AXIS = (0.3, -0.7)
"""Where the axis of a mounted membrane is in the sensor frame."""


def spiral(end_mm: float) -> np.ndarray:
    """Return places (N, 2) over the boundary."""
    radius_mm = np.linspace(0.0, end_mm, 200)
    return np.stack([radius_mm * np.cos(radius_mm), radius_mm * np.sin(radius_mm)], axis=-1)


def square(width_mm: float = 27.0, nodes: int = 61) -> np.ndarray:
    """Return places (N, 2) of a square."""
    axis_mm = np.linspace(-0.5 * width_mm, 0.5 * width_mm, nodes)
    return np.stack(np.meshgrid(axis_mm, axis_mm), axis=-1).reshape(-1, 2)


def disc(rings: int) -> np.ndarray:
    """Return places (N, 2) out to the boundary, on rings."""
    angles_rad = np.linspace(0.0, 2.0 * np.pi, 4 * rings, endpoint=False)
    ring = np.stack([np.cos(angles_rad), np.sin(angles_rad)], axis=-1)
    radius_mm = np.linspace(0.0, RIM_MM, rings)[1:, None, None]
    return np.concatenate([np.zeros((1, 2)), (radius_mm * ring).reshape(-1, 2)])


def radius(places_mm: np.ndarray) -> np.ndarray:
    """Return the distance (N,) from the axis of places (N, 2)."""
    return np.hypot(*places_mm.T)


def mesh_of(places_mm: np.ndarray, heights_mm: np.ndarray | None = None) -> trimesh.Trimesh:
    """Return a mesh over places (N, 2), with the heights of the cap if no others are given."""
    heights_mm = CAP.height(places_mm) if heights_mm is None else heights_mm
    points_mm = np.column_stack([places_mm, heights_mm])
    return trimesh.Trimesh(points_mm, Delaunay(places_mm).simplices, process=False)


def changed(mesh: trimesh.Trimesh, scale=(1.0, 1.0, 1.0), move_mm=(0.0, 0.0, 0.0)):
    """Return a mesh of other size at another place."""
    return trimesh.Trimesh(mesh.vertices * scale + move_mm, mesh.faces, process=False)


def turned(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return a mesh with the sides of its faces exchanged."""
    return trimesh.Trimesh(mesh.vertices, mesh.faces[:, ::-1], process=False)


def with_a_hole(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return a mesh without the faces on the axis."""
    kept = np.linalg.norm(mesh.triangles_center[:, :2], axis=-1) > 4.0
    return trimesh.Trimesh(mesh.vertices, mesh.faces[kept], process=False)


def body(base_mm: float) -> trimesh.Trimesh:
    """Return the cap over a flat base."""
    base = turned(changed(mesh_of(square()), (1.0, 1.0, 0.0), (0.0, 0.0, base_mm)))
    return mesh_of(square()) + base


def read(folder: Path, mesh: trimesh.Trimesh, width_mm: float = WIDTH_MM) -> MembraneShape:
    mesh.export(folder / "membrane.stl", file_type="stl")
    return height_field(folder, "membrane.stl", width_mm)


def grid_file(folder: Path, reach_mm: float, nodes: int = 81) -> str:
    axis_mm = np.linspace(-reach_mm, reach_mm, nodes)
    heights_mm = CAP.height(square(2.0 * reach_mm, nodes)).reshape(nodes, nodes)
    np.savez(folder / "membrane.npz", x_mm=axis_mm, y_mm=axis_mm, height_mm=heights_mm)
    return "membrane.npz"


@pytest.mark.parametrize(
    ("places", "height_mm", "slope"),
    [
        # Facets of 0.45, 1.1 and 2.25 mm are up to 1, 7 and 30 um inside of the sphere.
        (square(), 5e-6, 3e-5),
        (disc(40), 5e-6, 3e-5),
        (square(nodes=25), 5e-5, 1e-4),
        (square(nodes=13), 2e-3, 2e-3),
    ],
)
def test_a_file_gives_heights_normals_and_rays_of_the_cap(tmp_path, places, height_mm, slope):
    field = replace(read(tmp_path, mesh_of(places)), axis_mm=AXIS)
    cap = replace(CAP, axis_mm=AXIS)
    points = spiral(RIM_MM) + AXIS
    np.testing.assert_allclose(field.height(points), cap.height(points), atol=height_mm)
    np.testing.assert_allclose(field.normals(points), cap.normals(points), atol=slope)
    rays = -points / 40.0
    np.testing.assert_allclose(field.met_by(points, rays), cap.met_by(points, rays), atol=height_mm)


def test_the_light_on_a_ball_in_a_dome_from_a_file_is_that_in_the_cap(tmp_path):
    field = read(tmp_path, mesh_of(square()))
    pose = BallPose((5.0, -3.0), 3.0, 0.6)
    points = square(8.0, 41) + np.array(pose.centre_mm)
    leds_mm = np.array([[14.0, 0.0, 11.8], [-7.0, 12.0, 11.8], [-7.0, -12.0, 11.8]])
    shading = []
    for surface in (CAP, field):
        seen, normals, _ = draped_ball(points, -points / 40.0, pose, decay_mm=0.7, surface=surface)
        light, _ = light_directions(leds_mm, seen)
        shading.append(np.einsum("nkc,nc->nk", light, normals))
    np.testing.assert_allclose(*shading, atol=5e-5)


def test_copies_of_a_membrane_share_the_spline(tmp_path):
    field = read(tmp_path, mesh_of(square()))
    copy = replace(field, axis_mm=AXIS, rise_mm=0.1)
    assert copy.heights_mm is field.heights_mm
    assert copy == unpack(MembraneShape, pack(copy, {}, ""), {}, "")


def test_the_outer_side_of_a_body_is_the_membrane_whichever_side_its_faces_show(tmp_path):
    sheet, points = mesh_of(square()), spiral(RIM_MM)
    for mesh in (turned(sheet), body(-3.0), body(-0.3), turned(body(-3.0))):
        np.testing.assert_allclose(
            read(tmp_path, mesh).height(points), CAP.height(points), atol=5e-6
        )


def test_where_no_vertices_are_the_facets_are_followed(tmp_path):
    # A plateau 18 mm wide with vertices on its edge alone, as programs for design write it.
    places = disc(40)
    places = places[radius(places) > 9.0]
    heights_mm = 1.6 - 0.1 * (radius(places) - 9.0) ** 2
    field = read(tmp_path, mesh_of(places, heights_mm))
    np.testing.assert_allclose(field.height(spiral(8.5)), 1.6, atol=0.06)


def test_a_flange_around_the_boundary_leaves_the_dome_as_it_is(tmp_path):
    flange = square(40.0, 81)
    flange = flange[radius(flange) > 1.01 * RIM_MM]
    places, heights_mm = np.vstack([disc(40), flange]), np.zeros(len(disc(40)) + len(flange))
    heights_mm[: len(disc(40))] = CAP.height(disc(40))
    points = spiral(RIM_MM)
    field = read(tmp_path, mesh_of(places, heights_mm))
    np.testing.assert_allclose(field.height(points), CAP.height(points), atol=5e-5)


@pytest.mark.parametrize(
    ("mesh", "size", "reason"),
    [
        (changed(mesh_of(square()), 3 * (1e-3,)), "0.027 x 0.027", "metres"),
        (changed(mesh_of(square()), 3 * (1 / 25.4,)), "1.063 x 1.063", "inches"),
        (changed(mesh_of(square()), 3 * (0.1,)), "2.7 x 2.7", "centimetres"),
        (changed(mesh_of(square()), 3 * (1e3,)), "27000 x 27000", "micrometres"),
        (mesh_of(square(16.0)), "16 x 16", "cover"),
        (with_a_hole(mesh_of(square())), "27 x 27", "cover"),
        (changed(mesh_of(square()), move_mm=(13.5, 13.5, 0.0)), r"\(13.5, 13.5, ", "cover"),
        (changed(mesh_of(square(60.0)), move_mm=(3.0, 0.0, 0.0)), r"\(3, 0, ", "Height 0"),
        (changed(mesh_of(square()), move_mm=(0.0, 0.0, 5.0)), "27 x 27", "5.00 to 5.00 mm"),
        (changed(mesh_of(square()), move_mm=(0.0, 0.0, -2.0)), "27 x 27", "-2.00 to -2.00 mm"),
        (changed(mesh_of(square()), (1.0, 1.0, -1.0)), "27 x 27", "2.00 mm under"),
        (changed(body(-3.0), (1.0, -1.0, -1.0)), "27 x 27 x 5", "3.00 to 3.00 mm"),
        (changed(body(0.0), (1.0, -1.0, -1.0)), "27 x 27", "flat"),
        (changed(mesh_of(square()), (1.0, 1.0, 8.0)), "27 x 27", "16 mm high"),
    ],
)
def test_a_file_of_other_unit_zero_or_side_is_refused_with_its_size(tmp_path, mesh, size, reason):
    with pytest.raises(InputError, match=rf"{reason}.*{size}|{size}.*{reason}"):
        read(tmp_path, mesh)


def test_a_boundary_wider_than_the_file_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"28\.6 mm wide.*26 x 26"):
        read(tmp_path, mesh_of(disc(40)), 1.1 * WIDTH_MM)


def test_a_grid_of_heights_gives_the_cap_also_where_it_is_fine_or_has_gaps_outside(tmp_path):
    for nodes in (81, 1101):
        field = height_field(tmp_path, grid_file(tmp_path, 14.0, nodes), WIDTH_MM)
        points = spiral(RIM_MM)
        np.testing.assert_allclose(field.height(points), CAP.height(points), atol=5e-6)
    stored = dict(np.load(tmp_path / "membrane.npz"))
    stored["height_mm"][:40, :40] = np.nan
    np.savez(tmp_path / "membrane.npz", **stored)
    assert height_field(tmp_path, "membrane.npz", WIDTH_MM).height(np.zeros(2)) == pytest.approx(2)


@pytest.mark.parametrize("content", [b"", b"rubbish", b"solid a\nendsolid a\n", bytes(84)])
def test_a_mesh_that_cannot_be_used_is_refused(tmp_path, content):
    (tmp_path / "membrane.stl").write_bytes(content)
    with pytest.raises(InputError, match=r"membrane\.stl"):
        height_field(tmp_path, "membrane.stl", WIDTH_MM)


@pytest.mark.parametrize("content", [None, b"not an archive", 9.0, np.nan])
def test_a_grid_that_cannot_be_used_is_refused(tmp_path, content):
    if isinstance(content, bytes):
        (tmp_path / "membrane.npz").write_bytes(content)
    elif content is not None:
        grid_file(tmp_path, content)
    with pytest.raises(InputError, match=r"membrane\.npz"):
        height_field(tmp_path, "membrane.npz", WIDTH_MM)


def test_a_session_keeps_the_file_of_its_membrane(tmp_path, small_session):
    width_mm = read_session(small_session).sensor.working_diameter_mm
    cap = replace(CAP, diameter_mm=width_mm)
    places = square(1.1 * width_mm)
    mesh_of(places, cap.height(places)).export(tmp_path / "membrane.stl")
    text = (small_session / "session.toml").read_text()
    membrane = '\n[membrane]\nshape = "height_field"\nfile = "membrane.stl"\n'
    (tmp_path / "session.toml").write_text(text + membrane)
    session = read_session(tmp_path)
    assert session.surface.apex_height_mm == pytest.approx(2.0, abs=2e-5)
    write_description(session)
    assert read_session(tmp_path).surface == session.surface
