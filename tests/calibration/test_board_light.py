"""The white board and the membrane beside it, on a field that is shaded here."""

from dataclasses import replace

import numpy as np
import pytest
import scene

from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.least_squares import fit_least_squares
from gelpolight_core.calibration.ball_pixels import CoarseRayGrid
from gelpolight_core.calibration.board_light import BOARD_REFLECTANCE, BOARD_SD, BoardLight
from gelpolight_core.calibration.refinement_parameters import (
    LEDS,
    KnownOfSensor,
    terms_of_sensor,
)
from gelpolight_core.calibration.refinement_problem import JointProblem
from gelpolight_core.light.facet_interreflection import Slab
from gelpolight_core.light.gel_absorption import ABSORPTION
from gelpolight_core.light.led_lobe import LOBE
from gelpolight_core.light.membrane_brdf import MembraneBrdf
from gelpolight_core.light.parameter import PriorSource

LEDS_MM = np.array([[0.0, 10.0, -8.0], [-9.0, -5.0, -8.0], [9.0, -5.0, -8.0]])
GEL_MM = 14.0
UPRIGHT = np.tile([0.0, 0.0, 1.0], (3, 1))
MATT = MembraneBrdf()


def board(
    leds_mm: np.ndarray = LEDS_MM,
    *,
    share: float = 0.6,
    exponent: float = 1.0,
    axes: np.ndarray = UPRIGHT,
    loss_per_mm: tuple[float, float, float] = (0.0, 0.0, 0.0),
    returned: float = 0.0,
) -> BoardLight:
    """Return a board seen from above, beside a membrane of a share of its reflectance."""
    x, y = (m.ravel() for m in np.meshgrid(np.linspace(-8, 8, 17), np.linspace(-6, 6, 13)))
    points = np.stack([x, y, np.zeros_like(x)], axis=-1)
    light = np.empty((len(x), 3))
    for k, (led, axis) in enumerate(zip(leds_mm, axes, strict=True)):
        way = points - led
        far = np.linalg.norm(way, axis=1)
        to_axis = way @ axis / (far * np.linalg.norm(axis))
        gel = np.exp(-loss_per_mm[k] * (far + GEL_MM))
        light[:, k] = 100.0 * to_axis**exponent * way[:, 2] / far**3 * gel
    return BoardLight(
        points,
        np.tile([0.0, 0.0, -1.0], (len(x), 1)),
        np.full((len(x), 3), share),
        light,
        np.full((len(x), 3), returned),
        GEL_MM,
    )


def fitted(shown: BoardLight, half_angle_deg: float | None = None) -> dict[str, float]:
    """Return LEDs and terms of the light that the board alone shows."""
    used = (LEDS.key, LOBE.key, ABSORPTION.key)
    terms = terms_of_sensor(KnownOfSensor(LEDS_MM, None, half_angle_deg), used, flat=True)
    # Without a press, nothing tells of the membrane.
    parameters = [p for term in terms if term.key in used for p in term.parameters]
    problem = JointProblem([], tuple(parameters), shown)
    found = fit_least_squares(problem.all, problem.jacobian, problem.start, problem.limits)
    return problem.values(found.x).shared


def test_a_matt_membrane_reflects_what_it_shows_beside_the_board():
    assert board(share=0.6).membrane_ratio(LEDS_MM, MATT) == pytest.approx(0.6, rel=1e-6)


def test_a_lobe_that_the_camera_hardly_sees_leaves_more_reflectance():
    """Far from the mirror images of the lights, half of the light goes elsewhere."""
    glossy = board(share=0.4).membrane_ratio(LEDS_MM, MembraneBrdf(gloss=0.5, roughness=0.2))
    assert 0.6 < glossy < 0.8


def test_the_reflectance_for_interreflected_light_is_that_of_the_board_times_the_ratio():
    prior = board(share=0.8).membrane_reflectance(LEDS_MM, MATT)
    assert prior.mean == pytest.approx(0.8 * BOARD_REFLECTANCE)
    # At least as unsure as the board itself.
    assert 0.8 * BOARD_SD < prior.sd < 2.0 * 0.8 * BOARD_SD
    assert prior.source is PriorSource.WHITE_BOARD
    # Whatever it is: a board that disagrees with the balls is not dropped in silence.
    assert board(share=1.6).membrane_reflectance(LEDS_MM, MATT).mean > 1.4
    nothing = BoardLight(*(np.zeros((0, 3)),) * 5, GEL_MM)
    assert nothing.membrane_reflectance(LEDS_MM, MATT) is None


@pytest.mark.parametrize("stated", [None, (0.8, 0.8, 0.8)])
def test_light_that_comes_back_counts_neither_for_the_board_nor_for_the_membrane(stated):
    """More of it comes back to a white board than to a grey membrane."""
    reflectance = stated[0] if stated else BOARD_REFLECTANCE
    table, membrane = scene.table(), 0.5
    # A thin gel: more of the light comes back.
    view, slab = CoarseRayGrid.of(table, table.valid), Slab(5.0, 1.41, 1.41)
    points = table.grid.points_mm()
    cosines, lit = scene.flat_light(points)

    def seen(share: float) -> np.ndarray:
        matt = MembraneBrdf(interreflection=share)
        direct, back = view.light_at_rest(scene.LEDS, matt, slab)
        again = np.stack([view.at(back / direct, row) for row in points])
        return share * lit * (1.0 + share * again)

    of_board, of_membrane = seen(reflectance), seen(membrane)
    found = BoardLight.from_images(
        table,
        table.valid,
        of_membrane.astype(np.float32),
        (of_board / cosines).astype(np.float32),
        np.eye(3),
        scene.LEDS,
        view,
        slab,
        slab.thickness_mm,
        stated,
    )
    usual = reflectance * np.median((of_membrane / of_board)[table.valid])
    prior = found.membrane_reflectance(scene.LEDS, MATT)
    assert abs(usual / membrane - 1.0) > 0.03
    assert prior.mean == pytest.approx(membrane, rel=0.01)
    assert found.reflectance == pytest.approx(reflectance)
    # What is left of the board is the light of the LEDs alone.
    inside = np.abs(found.points_mm[:, :2]).max(axis=1) < 6.0
    left = found.light / scene.flat_light(found.points_mm[:, :2])[1]
    assert np.ptp(left[inside] / left[inside].mean()) < 0.003


def test_the_board_shows_the_lobe_of_the_leds():
    """Within the tolerances of soldered LEDs, without any ball press."""
    tilts = np.array([[0.08, -0.03], [-0.05, 0.06], [0.02, -0.07]])
    axes = np.concatenate([tilts, np.ones((3, 1))], axis=1)
    found = fitted(board(exponent=1.6, axes=axes))
    assert found["lobe_exponent"] == pytest.approx(1.6, abs=0.15)
    usual = fitted(board())
    assert usual["lobe_exponent"] == pytest.approx(1.0, abs=0.1)
    by_axis = [[found[f"lobe_axis_{axis}_{k}"] for axis in "xy"] for k in CHANNEL_KEYS]
    assert np.abs(np.array(by_axis) - tilts).mean() < 0.6 * np.abs(tilts).mean()


def test_a_data_sheet_says_more_of_the_lobe_than_none():
    """A half angle of 50 degrees is an exponent of 1.57."""
    unknown = fitted(board(exponent=1.57, returned=0.1))["lobe_exponent"]
    stated = fitted(board(exponent=1.57, returned=0.1), 50.0)["lobe_exponent"]
    assert abs(stated - 1.57) < abs(unknown - 1.57)
    assert stated == pytest.approx(1.57, abs=0.05)


def test_light_that_comes_back_makes_the_pattern_less_sure():
    clear = board(exponent=1.6)
    values = JointProblem([], tuple(_lambertian()), clear)
    sure = np.abs(values.priors(values.start)).max()
    unsure = JointProblem([], tuple(_lambertian()), board(exponent=1.6, returned=0.2))
    assert np.abs(unsure.priors(unsure.start)).max() < 0.3 * sure


def test_unknown_crosstalk_hides_the_pattern_of_the_leds():
    mixed = replace(board(exponent=1.6), separated=False)
    problem = JointProblem([], tuple(_lambertian()), mixed)
    assert mixed.residuals(problem.values(problem.start)).size == mixed.size == 0


def _lambertian():
    return terms_of_sensor(KnownOfSensor(LEDS_MM), (), flat=True)[0].parameters
