"""The parts of in-place calibration, each against something independent."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.closed_sensor.ball_contact import (
    BallContact,
    contact_radius_by_slopes,
    next_position,
    refine_centre_by_slopes,
)
from gelpolight_core.calibration.closed_sensor.pixel_scale import scale_from_pins, scale_from_punch
from gelpolight_core.calibration.closed_sensor.press_light_change import BallImage, press_lights
from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.reconstruction.closed_sensor.closed_depth import integrate_free_border
from gelpolight_core.reconstruction.height_map import normals_from_slopes, surface_slopes
from gelpolight_core.sensor.closed_sensor.polynomial_terms import TERMS, design_rows, position_axes
from gelpolight_core.sensor.closed_sensor.slope_model import (
    COLOUR_CELLS,
    ErrorCurve,
    InPlaceModel,
    colour_cells,
    evaluate_slopes,
)
from gelpolight_core.sensor.closed_sensor.working_grid import ImageSize, WorkingGrid
from gelpolight_core.stages.balls.contact_contour import ImageCircle


def pressed_ball(
    shape: tuple[int, int], ball: BallContact, decay: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return depth and slopes of a ball with an exponential drape, nodes."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    dx, dy = x - ball.x, y - ball.y
    rho = np.hypot(dx, dy)
    edge = ball.contact / np.sqrt(ball.radius**2 - ball.contact**2)
    inside = rho < ball.contact
    away = np.exp(-np.maximum(rho - ball.contact, 0.0) / decay)
    root = np.sqrt(np.maximum(ball.radius**2 - rho**2, 1.0))
    rim = np.sqrt(ball.radius**2 - ball.contact**2)
    depth = np.where(inside, root - rim + edge * decay, edge * decay * away)
    size = np.where(inside, rho / root, edge * away)
    turn = np.maximum(rho, 1e-9)
    return depth, (-size * dx / turn).astype(np.float32), (-size * dy / turn).astype(np.float32)


def test_slopes_of_a_ball_in_a_dome_are_those_of_two_spheres():
    cap = MembraneShape("spherical_cap", 160.0, 2000.0, axis_mm=(30.0, -20.0))
    dome_radius = (1000.0**2 + 160.0**2) / 320.0
    dome = np.array([30.0, -20.0, 160.0 - dome_radius])
    radius, contact, centre = 150.0, 60.0, np.array([480.0, 290.0, 225.0])
    towards = (dome - centre) / np.linalg.norm(dome - centre)
    # The contact is a circle around the line that joins both centres.
    x, y, _ = centre + np.sqrt(radius**2 - contact**2) * towards
    places = np.random.default_rng(4).uniform(-40.0, 40.0, (50, 2))

    def depth(dx: float, dy: float) -> np.ndarray:
        at = places + np.array([x + dx, y + dy])
        root = np.sqrt(dome_radius**2 - ((at - dome[:2]) ** 2).sum(axis=1))
        return (
            dome[2] + root - centre[2] + np.sqrt(radius**2 - ((at - centre[:2]) ** 2).sum(axis=1))
        )

    wanted = np.stack([depth(0.01, 0.0) - depth(-0.01, 0.0), depth(0.0, 0.01) - depth(0.0, -0.01)])
    wanted = wanted.T / 0.02
    found = BallContact(x, y, contact, radius, cap).slopes(*places.T)
    on_flat = BallContact(x, y, contact, radius).slopes(*places.T)
    # The lean is that of the dome beside the contact, not of the dome in front of it.
    assert np.abs(found - wanted).max() < 0.005
    assert np.abs(on_flat - wanted).max() > 0.02


def test_the_pass_over_a_frame_is_the_polynomial_of_the_fit():
    random = np.random.default_rng(1)
    change = random.normal(0.0, 0.4, (12, 17, 3)).astype(np.float32)
    coefficients = random.normal(0.0, 1.0, (TERMS, 2))
    found = np.stack(evaluate_slopes(coefficients, change), axis=-1)
    x, y = np.meshgrid(*position_axes(12, 17))
    wanted = design_rows(change.reshape(-1, 3), x.ravel(), y.ravel()) @ coefficients
    assert found.reshape(-1, 2) == pytest.approx(wanted, abs=2e-4)


def test_the_light_is_that_of_the_untouched_part_also_with_a_third_pressed():
    random = np.random.default_rng(3)
    y, x = np.mgrid[:240, :320] / 320.0
    background = (0.4 + np.stack([0.1 * x, -0.1 * x, 0.1 * y], axis=-1)).astype(np.float32)
    grid = WorkingGrid(ImageSize(320, 240), 0.06)
    light = np.array([0.8, 1.05, 1.0])
    seen = background * light + random.normal(0.0, 0.004, background.shape)
    seen[:, :108] *= random.uniform(0.9, 1.8, (240, 108, 3))
    press = BallImage("press", seen.astype(np.float32), 4.0)
    common, _ = press_lights([press], grid, background, np.full(3, 0.004))["press"]
    assert 1.0 + common.gain == pytest.approx(light, rel=0.003)


def test_normals_are_those_of_the_depth_map():
    depth, slope_x, slope_y = pressed_ball((60, 70), BallContact(34.0, 30.0, 14.0, 30.0), 6.0)
    found = normals_from_slopes(*surface_slopes((0.5 * depth).astype(np.float32), 0.5))
    wanted = np.stack([-slope_x, -slope_y, -np.ones_like(slope_x)], axis=-1)
    wanted /= np.linalg.norm(wanted, axis=-1, keepdims=True)
    y, x = np.mgrid[:60, :70]
    smooth = np.abs(np.hypot(x - 34.0, y - 30.0) - 14.0) > 2.0
    smooth[[0, -1]] = smooth[:, [0, -1]] = False
    assert np.abs(found - wanted)[smooth].max() < 0.01


def test_colours_and_slopes_that_no_ball_has_shown_are_flagged():
    seen = np.zeros((COLOUR_CELLS,) * 3, np.float32)
    plain = tuple(colour_cells(np.zeros(3, np.float32)))
    seen[plain] = 1.0
    grid = WorkingGrid(ImageSize(40, 32), 0.1)
    model = InPlaceModel(
        grid,
        np.full((32, 40, 3), 0.4, np.float32),
        np.zeros((TERMS, 2)),
        seen,
        0.5,
        ErrorCurve(np.array([0.0, 1.0]), np.array([0.1, 0.1]), 0.0, 0.0),
    )
    change = np.zeros((32, 40, 3), np.float32)
    change[3, 4] = (1.5, 0.0, -0.9)
    change[3, 5] = np.nan
    change[3, 6] = 1e30
    slope = np.zeros((32, 40), np.float32)
    slope[8, 9], slope[8, 10] = 0.54, 0.56
    found = model.extrapolated(change, slope, np.zeros_like(slope))
    assert set(zip(*np.nonzero(found), strict=True)) == {(3, 4), (3, 5), (3, 6), (8, 10)}


def test_the_next_ball_is_asked_for_where_the_membrane_is_seen():
    grid = WorkingGrid(ImageSize(100, 80), 0.1)
    lit = np.ones((80, 100), np.bool_)
    ball = BallContact(20.0, 20.0, 10.0, 30.0)
    x_mm, y_mm = next_position([ball], grid, lit)
    assert x_mm > 3.0 and y_mm > 2.0
    lit[:, 60:] = False
    x_mm, y_mm = next_position([ball], grid, lit)
    assert x_mm < 1.1 and y_mm > 2.0


@pytest.mark.parametrize("centre", [(70.0, 60.0), (4.0, 60.0), (70.0, 112.0)])
def test_depth_is_right_also_where_the_border_cuts_the_contact(centre):
    ball = BallContact(*centre, 20.0, 50.0)
    depth, slope_x, slope_y = pressed_ball((120, 160), ball, 5.0)
    found, crossed = integrate_free_border(
        slope_x, slope_y, pitch_mm=1.0, weight=np.ones(depth.shape, np.float32)
    )
    assert crossed == (centre != (70.0, 60.0))
    assert np.abs(found - depth).max() < 0.03 * depth.max()


def test_slopes_place_ball_and_contact():
    true = BallContact(82.3, 55.6, 24.0, 60.0)
    _, slope_x, slope_y = pressed_ball((120, 160), true, 6.0)
    guess = BallContact(79.0, 58.0, 20.0, 60.0)
    found = refine_centre_by_slopes(slope_x, slope_y, guess)
    assert (found.x, found.y) == pytest.approx((true.x, true.y), abs=0.05)
    contact = contact_radius_by_slopes(slope_x, slope_y, found, smoothing=0.5)
    assert contact == pytest.approx(true.contact, abs=0.6)


def scale(function, image, background, **size):
    """Return the scale from a whole image of a pressed object."""
    grid = WorkingGrid(ImageSize(background.shape[1], background.shape[0]), 1.0)
    return function([image.astype(np.float32)], background, **size, grid=grid, where="scale")


@pytest.mark.function("Find the scale from a pressed flat punch")
def test_a_flat_punch_gives_the_scale():
    """Its face changes nothing; the light changes where the membrane slopes around it."""
    background = np.full((240, 320, 3), 0.4, np.float32)
    y, x = np.mgrid[:240, :320]
    across, down = x - 171.3, y - 118.6
    away = np.hypot(across, down) - 43.0
    slope = np.where(away > 0.0, np.exp(-away / 9.0), 0.0) / (away + 43.0)
    lights = [np.cos(a) * across + np.sin(a) * down for a in (0.0, 2.1, 4.2)]
    image = background + 0.15 * slope[..., None] * np.stack(lights, axis=-1)
    image += np.random.default_rng(3).normal(0.0, 0.004, image.shape)
    found = scale(scale_from_punch, image, background, diameter_mm=5.0)
    assert found.mm_per_px[0] == found.mm_per_px[1] == pytest.approx(5.0 / 86.0, rel=0.02)
    assert abs(found.mm_per_px[0] - 5.0 / 86.0) < 2.0 * found.sd_mm_per_px[0]
    noise = background + np.random.default_rng(4).normal(0.0, 0.004, image.shape)
    with pytest.raises(InputError, match="no round edge"):
        scale(scale_from_punch, noise, background, diameter_mm=5.0)


@pytest.mark.function("Find the scale from a pressed pin grid")
@pytest.mark.parametrize(("aspect", "turn"), [(1.0, 0.6), (1.03, 0.07), (1.25, 0.3)])
def test_a_pin_grid_gives_the_scale(aspect, turn):
    spacing_px = 23.7
    background = np.full((240, 320, 3), 0.4, np.float32)
    image, (y, x) = background.copy(), np.mgrid[:240, :320]
    for i, j in product(range(-4, 5), range(-3, 4)):
        u = 160.0 + spacing_px * (i * np.cos(turn) - j * np.sin(turn))
        v = 120.0 + spacing_px / aspect * (i * np.sin(turn) + j * np.cos(turn))
        image += (0.2 * np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * 3.0**2)))[..., None]
    image += np.random.default_rng(3).normal(0.0, 0.004, image.shape)
    found = scale(scale_from_pins, image, background, spacing_mm=2.0)
    truth = np.array([1.0, aspect]) * 2.0 / spacing_px
    assert (np.abs(found.mm_per_px - truth) < 4.0 * np.array(found.sd_mm_per_px)).all()
    assert found.relative_sd < 1e-3
    assert len(set(found.mm_per_px)) == (1 if aspect == 1.0 else 2)
    assert ("not square" in found.quality.figures[1].text) is (aspect != 1.0)
    with pytest.raises(InputError, match="no regular grid"):
        scale(scale_from_pins, background, background, spacing_mm=2.0)


def test_a_wide_lens_is_corrected_with_the_pins_it_shows():
    """The lens draws its corner 20 % nearer to the middle; the pins reach near the border."""
    lens, spacing_px = (-0.3, 0.1), 30.0
    grid = WorkingGrid(ImageSize(400, 300), 1.0, lens=lens)
    steps = np.array(list(product(range(-5, 6), range(-4, 5))))
    flat = np.array([198.0, 152.0]) + spacing_px * steps
    pins = grid.to_pixels(flat - grid.middle_px)
    background, (y, x) = np.full((300, 400, 3), 0.4, np.float32), np.mgrid[:300, :400]
    image = background + 0.1 * np.random.default_rng(5).normal(0.0, 0.02, background.shape)
    for u, v in pins:
        image -= (0.2 * np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * 5.0**2)))[..., None]
    found = scale(scale_from_pins, image, background, spacing_mm=2.5)
    assert found.pins == np.count_nonzero((np.abs(pins - grid.middle_px) < grid.middle_px).all(1))
    assert found.mm_per_px[0] == pytest.approx(2.5 / spacing_px, abs=2.0 * found.sd_mm_per_px[0])
    assert sum(found.lens) == pytest.approx(sum(lens), abs=0.02)
    assert found.quality["lens_correction_percent"].value == pytest.approx(-20.0, abs=2.0)


@pytest.mark.parametrize(("aspect", "lens"), [(1.0, ()), (1.25, ()), (0.7, ()), (1.0, (-0.2,))])
@pytest.mark.parametrize("size", [(320, 240), (1280, 960)])
def test_nodes_are_averages_of_the_region_around_the_pixel_that_the_table_states(
    size, aspect, lens
):
    width, height = size
    region = (width // 9, height // 5, width // 2, height // 3)
    grid = WorkingGrid(ImageSize(*size), 0.02, aspect, region, lens)
    v, u = np.mgrid[:height, :width].astype(np.float32)
    nodes, table = grid.reduce(np.stack([u, v, u], axis=-1)), grid.table()
    inner = np.s_[1:-1, 1:-1]  # outside of the outermost pixels' centres nothing is known
    assert nodes.shape[:2] == grid.shape
    assert np.abs(nodes[..., 0] - table.u_px)[inner].max() < 1e-3
    assert np.abs(nodes[..., 1] - table.v_px)[inner].max() < 0.02 * grid.step_px[1]
    assert np.diff(grid.x_mm) == pytest.approx(grid.pitch_mm)
    assert np.diff(grid.y_mm) == pytest.approx(grid.pitch_mm)
    flat = np.array([[region[0] + 3.0, region[1] + 7.0]])
    middle = 0.5 * (np.array(size) - 1.0)  # of the whole image
    place = (flat - middle) * [0.02, 0.02 * aspect]
    pixel = grid.to_pixels(place)
    assert (np.abs(pixel - flat).max() < 1e-9) is not bool(lens)
    node = grid.on_nodes(ImageCircle(*pixel[0], 9.0))
    assert grid.x_mm[0] + node.x * grid.pitch_mm == pytest.approx(place[0, 0], abs=1e-5)
    assert grid.y_mm[0] + node.y * grid.pitch_mm == pytest.approx(place[0, 1], abs=1e-5)
    back = grid.in_image(node)
    assert (back.x, back.y, back.radius) == pytest.approx((*pixel[0], 9.0), rel=2e-3)


@pytest.mark.parametrize(
    "region", [(300, 10, 21, 100), (0, 200, 100, 41), (10, 10, 31, 100), (-1, 0, 100, 100)]
)
def test_a_region_that_cannot_hold_a_press_is_refused(region):
    with pytest.raises(InputError, match=r"is not inside the image of 320 x 240 pixels or below"):
        WorkingGrid(ImageSize(320, 240), 0.1, region_px=region)


def test_a_grid_of_square_pixels_and_the_whole_image_is_named_as_in_earlier_programs():
    usual = WorkingGrid(ImageSize(320, 240), 0.1)
    assert repr(usual) == "WorkingGrid(image=ImageSize(width=320, height=240), mm_per_px=0.1)"
    others = [
        replace(usual, aspect=2.0),
        replace(usual, region_px=(0, 0, 320, 239)),
        replace(usual, lens=(-0.1,)),
    ]
    assert len({repr(grid) for grid in (usual, *others)}) == 4
