"""Refraction at flat layers: against the paper's Eq. (3), Fermat's principle and a round trip."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.geometry.refraction import build_stack, camera_to_membrane, membrane_to_camera
from gelpolight_core.geometry.sensor_frame import TopPlane


def tilted_plane(tilt_x: float, tilt_y: float, distance_mm: float = 39.0) -> TopPlane:
    """Return a top surface tilted by two small slopes."""
    normal = np.array([tilt_x, tilt_y, 1.0])
    normal /= np.linalg.norm(normal)
    return TopPlane((float(normal[0]), float(normal[1]), float(normal[2])), distance_mm)


def corrected_radius_px(
    radius_px: float, focal_px: float, *, index: float, gel_mm: float, air_mm: float
) -> float:
    """Return the corrected image radius d' of the paper's Eq. (3)."""
    tan_alpha = radius_px / focal_px
    tan_beta = math.tan(math.asin(math.sin(math.atan(tan_alpha)) / index))
    return focal_px * (air_mm * tan_alpha + gel_mm * tan_beta) / (gel_mm + air_mm)


@given(st.floats(0.0, 600.0), st.floats(1.0, 2.5), st.floats(0.5, 30.0), st.floats(1.0, 60.0))
def test_one_face_on_the_axis_is_the_papers_equation_3(radius_px, index, gel_mm, air_mm):
    focal_px = 1000.0
    stack = build_stack(air_mm + gel_mm, elastomer_thickness_mm=gel_mm, elastomer_index=index)
    direction = np.array([radius_px / focal_px, 0.0, 1.0])
    point, _ = camera_to_membrane(direction, TopPlane((0.0, 0.0, 1.0), air_mm + gel_mm), stack)
    expected_px = corrected_radius_px(
        radius_px, focal_px, index=index, gel_mm=gel_mm, air_mm=air_mm
    )
    assert point[0] * focal_px / (air_mm + gel_mm) == pytest.approx(expected_px, abs=1e-9)
    assert point[1] == 0.0


@given(
    st.floats(-13.0, 13.0),
    st.floats(-13.0, 13.0),
    st.floats(-0.05, 0.05),
    st.floats(-0.05, 0.05),
    st.sampled_from([0.0, 2.0]),
)
def test_membrane_to_pixel_and_back_is_the_same_point(x, y, tilt_x, tilt_y, window_mm):
    plane = tilted_plane(tilt_x, tilt_y)
    stack = build_stack(
        39.0, elastomer_thickness_mm=14.0, elastomer_index=1.41, window_thickness_mm=window_mm
    )
    back, _ = camera_to_membrane(membrane_to_camera(np.array([x, y]), plane, stack), plane, stack)
    np.testing.assert_allclose(back, [x, y], atol=1e-9)


def test_the_ray_takes_the_quickest_path():
    """Fermat: the crossing points of the faces make the optical path an extremum."""
    stack = build_stack(
        39.0, elastomer_thickness_mm=14.0, elastomer_index=1.41, window_thickness_mm=2.0
    )
    target = 9.0

    def optical_path(crossings: np.ndarray) -> float:
        nodes = np.concatenate([[0.0], crossings, [target]])
        lengths = np.hypot(np.diff(nodes), stack.thicknesses_mm)
        return float(lengths @ np.array(stack.indices))

    quickest = minimize(optical_path, [5.0, 5.5], options={"gtol": 1e-12}).x
    direction = membrane_to_camera(np.array([target, 0.0]), TopPlane((0.0, 0.0, 1.0), 39.0), stack)
    assert direction[0] * stack.thicknesses_mm[0] == pytest.approx(quickest[0], abs=1e-5)


def test_the_ray_slope_is_where_the_ray_meets_a_higher_surface():
    """Moving a millimetre from elastomer to air shifts the visible point by the ray slope."""
    plane = tilted_plane(0.01, -0.02)
    stack = build_stack(39.0, elastomer_thickness_mm=14.0, elastomer_index=1.41)
    thinner = build_stack(38.0, elastomer_thickness_mm=13.0, elastomer_index=1.41)
    direction = np.array([0.2, -0.1, 1.0])
    point, ray_slope = camera_to_membrane(direction, plane, stack)
    closer, _ = camera_to_membrane(direction, plane, thinner)
    np.testing.assert_allclose(point + 1.0 * ray_slope, closer, atol=1e-12)


def test_rays_that_never_reach_the_surface_are_not_numbers():
    stack = build_stack(39.0, elastomer_thickness_mm=14.0, elastomer_index=1.41)
    point, _ = camera_to_membrane(
        np.array([1.0, 0.0, -0.1]), TopPlane((0.0, 0.0, 1.0), 39.0), stack
    )
    assert np.isnan(point).all()


@given(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-0.02, 0.02), st.floats(-0.02, 0.02))
def test_a_point_of_a_curved_membrane_is_seen_like_one_on_a_thicker_slab(x, y, tilt_x, tilt_y):
    cap, plane = (
        MembraneShape("spherical_cap", 2.0, 26.0, (-0.4, 0.3)),
        tilted_plane(tilt_x, tilt_y),
    )
    gel = {"elastomer_index": 1.41, "window_thickness_mm": 2.0}
    stack = build_stack(plane.distance_mm, elastomer_thickness_mm=12.0, **gel)
    place = np.array([x, y])
    up = float(cap.height(place))
    higher = TopPlane(plane.normal_camera, plane.distance_mm + up)
    thicker = build_stack(higher.distance_mm, elastomer_thickness_mm=12.0 + up, **gel)
    seen = membrane_to_camera(place, plane, stack, cap)
    np.testing.assert_allclose(seen, membrane_to_camera(place, higher, thicker), atol=1e-11)
    back, slope = camera_to_membrane(seen, plane, stack, cap)
    np.testing.assert_allclose(back, place, atol=1e-9)
    np.testing.assert_allclose(slope, camera_to_membrane(seen, higher, thicker)[1], atol=1e-11)
