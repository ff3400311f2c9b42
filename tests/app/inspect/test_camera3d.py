"""The camera of the 3D view."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.inspect.camera3d import PRESETS, Camera

SIZE = (640, 480)
angles = st.tuples(st.floats(-180.0, 180.0), st.floats(5.0, 90.0))


@given(angles, st.floats(-8.0, 8.0), st.floats(-8.0, 8.0))
def test_the_ray_through_a_projected_point_goes_through_the_point(
    angle: tuple[float, float], x: float, y: float
) -> None:
    camera = Camera(*angle)
    point = np.array([x, y, 0.4])
    at = camera.project(point[None], SIZE)[0]
    start, along = camera.ray(float(at[0]), float(at[1]), SIZE)
    nearest = start + along * ((point - start) @ along)
    assert np.linalg.norm(nearest - point) < 1e-6


@given(angles)
def test_its_axes_are_at_right_angles_however_it_is_turned(angle: tuple[float, float]) -> None:
    camera = Camera(*angle)
    axes = np.stack([camera.right(), camera.up(), camera.backward()])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-9)


def test_from_the_top_the_surface_lies_as_in_the_camera_s_picture() -> None:
    camera = Camera(*PRESETS["top"])
    right, down = camera.project(np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), SIZE)
    assert right[0] > 320.0 and right[1] == pytest.approx(240.0)
    assert down[1] > 240.0 and down[0] == pytest.approx(320.0)


@pytest.mark.parametrize("preset", list(PRESETS))
@pytest.mark.parametrize("size", [(640, 480), (400, 700), (1200, 300)])
def test_every_preset_shows_all_of_the_disc(preset: str, size: tuple[int, int]) -> None:
    camera = Camera().seen_from(*PRESETS[preset]).fitted(13.0, size)
    around = np.linspace(0.0, 2.0 * np.pi, 90)
    rim = np.stack([13.0 * np.cos(around), 13.0 * np.sin(around), 0.0 * around], axis=-1)
    at = camera.project(rim, size)
    assert (at >= 0.0).all() and (at <= np.array(size)).all()


def test_panning_moves_the_surface_with_the_pointer() -> None:
    camera = Camera()
    before = camera.project(np.zeros((1, 3)), SIZE)[0]
    after = camera.panned(30.0, -20.0, SIZE[1]).project(np.zeros((1, 3)), SIZE)[0]
    np.testing.assert_allclose(after - before, [30.0, -20.0], atol=1.5)
