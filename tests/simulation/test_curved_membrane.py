"""The virtual sensor with a spherical cap compared with closed formulas that are written here."""

import csv
import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import map_coordinates
from scipy.optimize import minimize

from gelpolight_core.simulation.design_parts import (
    BallPressDesign,
    CameraDesign,
    LayerDesign,
    MembraneDesign,
    PhotometryDesign,
    PressDesign,
    SessionDesign,
)
from gelpolight_core.simulation.indenters import (
    BallIndenter,
    CuboidIndenter,
    CylinderIndenter,
    press_surface,
)
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.simulated_session import pressed_membrane, simulate_session
from gelpolight_core.simulation.virtual_sensor import BareMembrane, VirtualSensor

APEX_MM, RIM_MM = 2.0, 13.0
AXIS_MM = (0.6, -0.9)
SPHERE_MM = (RIM_MM**2 + APEX_MM**2) / (2.0 * APEX_MM)
PLAIN = MembraneDesign(
    working_diameter_mm=2.0 * RIM_MM,
    axis_mm=AXIS_MM,
    apex_height_mm=APEX_MM,
    specular_weight=0.0,
    variation=0.0,
    speck_count=0,
)
INDEX, THICK_MM, AWAY_MM, TILT_DEG, AZIMUTH_DEG = 1.41, 12.0, 38.0, 2.0, -55.0
DESIGN = SensorDesign(
    camera=CameraDesign(
        distortion=(0.0, 0.0, 0.0, 0.0), shot_variance=0.0, read_sd=0.0, blur_sigma_px=0.0
    ),
    layers=LayerDesign(AWAY_MM, TILT_DEG, AZIMUTH_DEG, THICK_MM, INDEX, 0.0),
    membrane=PLAIN,
    photometry=PhotometryDesign(crosstalk=((1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0))),
).scaled(0.5)
# Unlike in x and y, so that an exchange of the two shows.
PLACES = [(0.4, -0.3), (-6.0, 2.5), (3.0, 8.0), (7.5, -4.0), (-2.0, -9.0), (8.0, 8.5)]


def height(x_mm: float, y_mm: float) -> float:
    """Return the height of the cap over the plane of its boundary."""
    away = math.dist((x_mm, y_mm), AXIS_MM)
    return math.sqrt(SPHERE_MM**2 - away**2) - (SPHERE_MM - APEX_MM)


def seen(point: tuple[float, float, float]) -> tuple[np.ndarray, float]:
    """Return the pixel (u, v) of a point, on the way of the shortest time, and the transmission."""
    x, y, z = point
    camera = (0.0, 0.0, -AWAY_MM)

    def travel(face: np.ndarray) -> float:
        at = (face[0], face[1], -THICK_MM)
        return math.dist(camera, at) + INDEX * math.dist(at, point)

    share = (AWAY_MM - THICK_MM) / (AWAY_MM + z)
    fx, fy = minimize(travel, (share * x, share * y), method="Nelder-Mead", tol=1e-13).x
    tilt, azimuth = math.radians(TILT_DEG), math.radians(AZIMUTH_DEG)
    normal = np.array([math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), 0.0])
    normal[2] = math.cos(tilt)
    across = np.array([1.0, 0.0, 0.0]) - normal[0] * normal
    across /= np.linalg.norm(across)
    ray = fx * across + fy * np.cross(normal, across) + (AWAY_MM - THICK_MM) * normal
    lens = DESIGN.camera
    pixel = np.array([lens.fx * ray[0] / ray[2] + lens.cx, lens.fy * ray[1] / ray[2] + lens.cy])
    cos_air = (AWAY_MM - THICK_MM) / math.dist(camera, (fx, fy, -THICK_MM))
    cos_gel = math.sqrt(1.0 - (1.0 - cos_air**2) / INDEX**2)
    across_share = ((cos_air - INDEX * cos_gel) / (cos_air + INDEX * cos_gel)) ** 2
    along_share = ((INDEX * cos_air - cos_gel) / (INDEX * cos_air + cos_gel)) ** 2
    return pixel, 1.0 - 0.5 * (across_share + along_share)


def lit(point: tuple[float, float, float], normal: tuple[float, float, float]) -> np.ndarray:
    """Return the brightness of a white point under each LED, with its transmission."""
    values = []
    for led in DESIGN.leds:
        way = np.array([led.x_mm, led.y_mm, -led.height_mm]) - point
        r = float(np.linalg.norm(way))
        values.append(led.power * (-way[2] / r) * (way @ np.array(normal) / r) / r**2)
    return np.array(values) * seen(point)[1]


def shown(image: np.ndarray, point: tuple[float, float, float]) -> np.ndarray:
    """Return the three channels of an image where a point is seen."""
    u, v = seen(point)[0]
    return np.array([map_coordinates(image[..., k], [[v], [u]], order=3)[0] for k in range(3)])


@pytest.fixture(scope="module")
def sensor():
    """Return the curved sensor."""
    return VirtualSensor(DESIGN)


def test_the_cap_at_rest_is_as_bright_as_snell_inverse_square_and_cosine_say(sensor):
    image = sensor.brightness(BareMembrane())
    ratios = []
    for x, y in PLACES:
        point = (x, y, height(x, y))
        centre = (*AXIS_MM, APEX_MM - SPHERE_MM)
        normal = tuple((c - p) / SPHERE_MM for c, p in zip(centre, point, strict=True))
        ratios.append(shown(image, point) / lit(point, normal))
    # The same reflectance and exposure everywhere, in all channels.
    expected = sensor.exposure * PLAIN.diffuse_reflectance
    assert np.array(ratios) == pytest.approx(expected, rel=1e-4)


def test_the_image_ends_at_the_boundary_of_the_cap(sensor):
    image = sensor.brightness(BareMembrane()).sum(axis=2)
    for angle in np.radians([160.0, 205.0, 340.0]):
        radii = np.arange(12.5, 13.5, 0.005)
        way = np.array([math.cos(angle), math.sin(angle)])
        pixels = [seen((*(AXIS_MM + r * way), 0.0))[0] for r in radii[::20]]
        u, v = (np.interp(radii, radii[::20], places) for places in np.transpose(pixels))
        along = map_coordinates(image, [v, u], order=1)
        # Half of the light is seen at the boundary: one pixel is 0.05 mm.
        edge = radii[np.argmax(along < 0.5 * along[0])]
        assert edge == pytest.approx(RIM_MM, abs=0.03)


@pytest.mark.parametrize("shape", [CylinderIndenter(5.0, 1.0), CuboidIndenter(5.0, 1.0)])
def test_a_flat_end_is_a_plane_in_space_at_the_stated_depth_under_its_centre(sensor, shape):
    x0, y0 = 4.0, -5.0
    state = pressed_membrane(DESIGN, shape, x_mm=x0, y_mm=y0, yaw_deg=20.0)
    surface = state.surface
    x, y = np.meshgrid(surface.x_mm, surface.y_mm)
    rest = np.vectorize(height)(x, y)
    face = np.hypot(x - x0, y - y0) < 2.3
    assert surface.contact[face].all()
    # The rounded edge is 0.05 mm wide; the cubic interpolation feels it at 0.2 mm by some nm.
    assert rest[face] - surface.depth_mm[face] == pytest.approx(height(x0, y0) - 1.0, abs=5e-5)
    assert np.ptp(surface.depth_mm[face]) > 0.5
    # It is as bright as a level plane at that place in space.
    image = sensor.brightness(state)
    for dx, dy in ((0.0, 0.0), (1.2, 0.4), (-0.5, -1.5)):
        point = (x0 + dx, y0 + dy, height(x0, y0) - 1.0)
        ratio = shown(image, point) / lit(point, (0.0, 0.0, -1.0))
        assert ratio == pytest.approx(sensor.exposure * PLAIN.diffuse_reflectance, rel=1e-4)


def test_a_ball_in_the_cap_lies_at_the_stated_depth_under_its_centre():
    x0, y0, radius, depth = -5.0, 3.0, 4.0, 0.9
    surface = press_surface(BallIndenter(radius, depth), x_mm=x0, y_mm=y0, rest=PLAIN)
    x, y = np.meshgrid(surface.x_mm - x0, surface.y_mm - y0)
    rest = np.vectorize(height)(x + x0, y + y0)
    z = rest - surface.depth_mm
    middle = height(x0, y0) - depth + radius
    touched = surface.contact & (np.hypot(x, y) < 1.8)
    distance = np.sqrt(x**2 + y**2 + (z - middle) ** 2)
    assert touched.sum() > 5000
    # The contact ends at about 1.9 mm, where cubic interpolation is wrong by some 10 nm.
    assert distance[touched] == pytest.approx(radius, abs=1e-4)
    # Elsewhere the membrane is nearer to the camera than the ball.
    assert distance.min() > radius - 1e-4
    # The indentation is largest where the cap is higher, towards the axis.
    assert surface.depth_mm.max() > depth + 0.01


def test_a_session_of_a_curved_sensor_has_its_shape_and_no_whiteboard(tmp_path):
    out = tmp_path / "curved"
    design = replace(
        SensorDesign(),
        membrane=replace(SensorDesign().membrane, apex_height_mm=1.5),
        session=SessionDesign(response_pictures=3, single_led=True),
        balls=(BallPressDesign(3.0, 1.0, -2.0, 4.0),),
        presses=(PressDesign("cylinder", 5.0, 0.8, -4.0, 3.0),),
    )
    simulate_session(design, out, seed=3, scale=0.1)
    text = tomllib.loads((out / "session.toml").read_text())
    assert text["membrane"] == {"shape": "spherical_cap", "apex_height_mm": 1.5}
    assert "response" not in text
    images = {folder.name for folder in out.iterdir() if list(folder.glob("*.png"))}
    assert images == {"checkerboard", "top_pose", "mirror", "background", "balls", "presses"}
    with (out / "presses" / "truth.csv").open() as stream:
        (row,) = csv.DictReader(stream)
    with np.load(out / "truth" / "cylinder_s5_d080.npz") as truth:
        start, pitch = (float(truth["y0_mm"]), float(truth["x0_mm"])), float(truth["pitch_mm"])
        at = [[(3.0 - start[0]) / pitch], [(-4.0 - start[1]) / pitch]]
        depth = map_coordinates(truth["depth_mm"], at, order=1)[0]
    # Cells of 0.27 mm: linear interpolation of the cap is wrong by 1/8 of its bend over one.
    assert depth == pytest.approx(float(row["height_mm"]), abs=4e-4)
