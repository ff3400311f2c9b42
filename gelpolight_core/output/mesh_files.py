"""Files that hold the surface as a triangle mesh: PLY, STL and glTF."""

from __future__ import annotations

from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.reconstruction.height_map import Flag, HeightMap


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangle mesh of the membrane in the sensor frame.

    Attributes
    ----------
    points_mm : (N, 3) float32
        (x, y, height over the plane of the boundary).
    triangles : (M, 3) int32
        Corners, counter-clockwise seen from the camera: the normals point towards it (z < 0).
    depth_mm : (N,) float32
    flags : (N,) uint8
    normals : (N, 3) float32 or None
    """

    points_mm: NDArray[np.float32]
    triangles: NDArray[np.int32]
    depth_mm: NDArray[np.float32]
    flags: NDArray[np.uint8]
    normals: NDArray[np.float32] | None


def mesh_of(heightmap: HeightMap, *, stride: int = 1) -> Mesh:
    """Return the surface as triangles, two to each cell of the grid.

    A cell is left out when any pixel in it is flagged as outside or has no finite depth; points
    that no cell uses are left out too.

    Parameters
    ----------
    heightmap : HeightMap
        The surface.
    stride : int, optional
        Use only every n-th row and column, for smaller files.

    Raises
    ------
    ValueError
        If `stride` is below 1.
    InputError
        If no cell is left.
    """
    if stride < 1:
        raise ValueError(f"stride = {stride}, expected 1 or more")
    depth_mm = heightmap.depth_mm[::stride, ::stride].astype(np.float32)
    used = ~_bad_cells(heightmap, stride)
    if not used.any():
        raise InputError(
            "No part of the surface is in the working area", heightmap.source, Remedy.CHECK_AREA
        )
    first = np.arange(depth_mm.size, dtype=np.int32).reshape(depth_mm.shape)
    corner, right, below, across = (
        part[used] for part in (first[:-1, :-1], first[:-1, 1:], first[1:, :-1], first[1:, 1:])
    )
    triangles = np.stack([corner, below, right, right, below, across], axis=-1).reshape(-1, 3)
    used_mask = np.zeros(depth_mm.size, dtype=bool)
    used_mask[triangles] = True
    numbers = np.cumsum(used_mask, dtype=np.int32) - np.int32(1)
    x_mm, y_mm = np.meshgrid(heightmap.x_mm[::stride], heightmap.y_mm[::stride])
    height_mm = heightmap.height_mm[::stride, ::stride]
    points_mm = np.stack([x_mm, y_mm, height_mm], axis=-1, dtype=np.float32, casting="same_kind")
    normals = heightmap.normals
    if normals is not None:
        normals = normals[::stride, ::stride].reshape(-1, 3)[used_mask].astype(np.float32)
    return Mesh(
        points_mm=points_mm.reshape(-1, 3)[used_mask],
        triangles=numbers[triangles],
        depth_mm=depth_mm.ravel()[used_mask],
        flags=heightmap.flags[::stride, ::stride].ravel()[used_mask],
        normals=normals,
    )


def _bad_cells(heightmap: HeightMap, stride: int) -> NDArray[np.bool_]:
    """Cells of the thinned grid with any pixel, corners included, that cannot be part of a mesh."""
    bad = (heightmap.flags & Flag.OUTSIDE.value).astype(bool) | ~np.isfinite(heightmap.depth_mm)
    for _ in range(2):
        cells = max((bad.shape[0] - 1) // stride, 0)
        reach = [bad[k : k + cells * stride : stride] for k in range(stride + 1)]
        bad = np.logical_or.reduce(reach).T
    return bad


def write_ply(mesh: Mesh, file: BinaryIO) -> None:
    """Write a binary PLY with normals, depth and flags on each point.

    Parameters
    ----------
    mesh : Mesh
        The mesh.
    file : binary file
        Open for writing.
    """
    from trimesh.exchange.ply import export_ply  # slow to import, and only needed here

    surface = _as_trimesh(mesh)
    surface.vertex_attributes["depth_mm"] = mesh.depth_mm
    surface.vertex_attributes["flags"] = mesh.flags
    file.write(export_ply(surface, vertex_normal=mesh.normals is not None))


def write_stl(mesh: Mesh, file: BinaryIO) -> None:
    """Write a binary STL: triangles only.

    Parameters
    ----------
    mesh : Mesh
        The mesh.
    file : binary file
        Open for writing.
    """
    from trimesh.exchange.stl import export_stl

    file.write(export_stl(_as_trimesh(mesh)))


def write_gltf(mesh: Mesh, file: BinaryIO) -> None:
    """Write a binary glTF. The vertices are in mm. The node scales them to metres.

    Parameters
    ----------
    mesh : Mesh
        The mesh.
    file : binary file
        Open for writing.
    """
    import trimesh
    from trimesh.exchange.gltf import export_glb

    scene = trimesh.Scene()
    scene.add_geometry(
        _as_trimesh(mesh), node_name="membrane", transform=np.diag([1e-3, 1e-3, 1e-3, 1.0])
    )
    content = export_glb(scene, include_normals=mesh.normals is not None)  # type: ignore[no-untyped-call]
    file.write(content)


def _as_trimesh(mesh: Mesh):  # type: ignore[no-untyped-def]
    import trimesh

    return trimesh.Trimesh(
        vertices=mesh.points_mm,
        faces=mesh.triangles,
        vertex_normals=mesh.normals,
        process=False,
        validate=False,
    )
