"""What counts as a contact: shallow relief does, noise does not; what the sensor cannot show."""

from dataclasses import replace
from functools import lru_cache

import known_press
import numpy as np
import pytest

from gelpolight_core.reconstruction.frame_checks import small_image_notes, visible_depth_notes
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.solver import SolveRequest
from gelpolight_core.reconstruction.trace import EFFORTS
from gelpolight_core.simulation.indenters import BallIndenter, CylinderIndenter
from gelpolight_core.studies.exact_sensor import ExactPress, ExactSensor, matt_design
from gelpolight_core.studies.image_case_helpers import depth_error, rms_um

AT_MM = (1.0, -2.0)
EMPTY_FRAMES = 60


@lru_cache(maxsize=3)
def sensor(scale: float) -> ExactSensor:
    """Return a sensor of 1280 x 960 pixels, scaled, with its exact calibration."""
    return known_press.known_sensor(matt_design(scale))


def face_um(found: object, at_mm: tuple[float, float]) -> float:
    """Return the median depth of the middle of a face 5 mm wide."""
    x, y = np.meshgrid(found.x_mm, found.y_mm)
    middle = np.hypot(x - at_mm[0], y - at_mm[1]) < 2.2
    return float(1e3 * np.median(found.depth_mm[middle]))


@pytest.mark.parametrize(
    ("depth_um", "noisy", "effort"),
    [(10.0, False, "best"), (10.0, True, "fast"), (20.0, True, "best")],
)
def test_shallow_faces_are_seen(depth_um, noisy, effort):
    """By single blocks of pixels all of these read 0."""
    known = sensor(0.5)
    press = known_press.on(
        known, CylinderIndenter(5.0, 1e-3 * depth_um), x_mm=AT_MM[0], y_mm=AT_MM[1]
    )
    frame = known.noisy(press.frame, seed=3) if noisy else press.frame
    found = Reconstructor(known.calibration, effort=effort).depth(frame, normals=False)
    assert face_um(found, AT_MM) == pytest.approx(depth_um, abs=1.0)


def test_the_stated_smallest_depth_is_seen_and_half_of_it_is_not():
    known = sensor(0.5)
    reconstruct = Reconstructor(known.calibration, effort="fast")
    least_um = 1e3 * (reconstruct.visible_depth_mm or 0.0)
    # 50 dB, 640 x 480 pixels.
    assert 8.0 < least_um < 20.0
    for at_mm in ((0.0, 0.0), (5.0, 6.0)):
        for share, seen in ((1.0, True), (0.3, False)):
            face = CylinderIndenter(5.0, 1e-3 * share * least_um)
            press = known_press.on(known, face, x_mm=at_mm[0], y_mm=at_mm[1])
            found = reconstruct.depth(known.noisy(press.frame, seed=1), normals=False)
            assert found.visible_depth_mm == reconstruct.visible_depth_mm
            wanted = share * least_um if seen else 0.0
            assert face_um(found, at_mm) == pytest.approx(wanted, abs=1.5)


def test_noise_is_no_contact():
    known = sensor(0.25)
    bare = known.bare()
    solver = Reconstructor(known.calibration).solver
    for seed in range(EMPTY_FRAMES):
        found = solver.depth(known.noisy(bare, seed=seed), SolveRequest("fast", normals=False))
        assert "integration" in found.trace.skipped_names


@pytest.mark.parametrize("off", [0.97, 1.03])
def test_a_background_that_is_saturated_is_no_contact_where_its_light_is_filled_in(off):
    known = sensor(0.25)
    full = known.calibration.data.full
    brighter = np.float32(1.1 / full.background.max())
    true = full.background * brighter
    filled = np.where(true > 1.0, off * true, true).astype(np.float32)
    calibration = known.calibration.changed(full=replace(full, background=filled))
    solver = Reconstructor(calibration).solver
    frame = np.minimum(known.bare() * brighter, 1.0)
    assert (frame == 1.0).any(axis=2).sum() > 100
    assert "integration" in solver.needs(known.noisy(frame), SolveRequest()).skipped_names
    led_x, led_y = np.argwhere((true > 1.0).any(axis=2)).mean(axis=0)[::-1]
    grid = calibration.table.grid
    at_mm = (
        float(np.interp(led_x, np.arange(grid.x_mm.size), grid.x_mm)),
        float(np.interp(led_y, np.arange(grid.y_mm.size), grid.y_mm)),
    )
    press = known_press.on(known, BallIndenter(3.0, 0.1), x_mm=at_mm[0], y_mm=at_mm[1])
    pressed = np.minimum(press.frame * brighter, 1.0)
    needed = solver.needs(known.noisy(pressed), SolveRequest())
    assert "integration" in needed.done, "other channels show it"


def test_a_shallow_face_beside_a_deep_one_is_seen():
    known = sensor(0.5)
    deep = known_press.on(known, CylinderIndenter(4.0, 0.5), x_mm=-7.0)
    shallow = known_press.on(known, CylinderIndenter(5.0, 0.03), x_mm=6.0)
    # The two do not light each other.
    frame = deep.frame * (shallow.frame / np.maximum(known.bare(), 1e-6))
    found = Reconstructor(known.calibration, effort="fast").depth(frame, normals=False)
    assert face_um(found, (6.0, 0.0)) == pytest.approx(30.0, abs=3.0)


def test_a_calibration_whose_noise_hides_presses_says_so():
    known = sensor(0.25)
    deaf = known.calibration.changed(noise=np.full(3, 0.2))
    press = known_press.on(known, BallIndenter(4.0, 0.05))
    for effort in EFFORTS:
        reconstruct = Reconstructor(deaf, effort=effort)
        found = reconstruct.depth(press.frame)
        assert reconstruct.visible_depth_mm is not None
        (note,) = visible_depth_notes(reconstruct.visible_depth_mm)
        assert note in found.findings
    assert not visible_depth_notes(Reconstructor(known.calibration).visible_depth_mm or 1.0)


@pytest.mark.parametrize("effort", ["fast", "best"])
def test_small_images_are_solved_at_a_scale_that_resolves_the_drape(effort):
    """64 x 48 pixels at a quarter scale: nodes of 2 mm, and a plateau of 1 mm that reads 0.85."""
    known = sensor(0.05)
    press = known_press.on(known, CylinderIndenter(5.0, 1.0), x_mm=0.5, y_mm=0.3)
    found, best = (
        Reconstructor(known.calibration, effort=e).depth(press.frame) for e in (effort, "best")
    )
    np.testing.assert_array_equal(found.depth_mm, best.depth_mm)
    assert found.trace.effort == "best"
    assert (f"effort {effort}" in found.trace.skipped_names) == (effort != "best")
    (note,) = small_image_notes(found.pitch_mm, 0.7)
    assert note in found.findings


@lru_cache(maxsize=1)
def steep_press(decay_mm: float) -> tuple[ExactSensor, ExactPress]:
    """Return a press with steep walls, and its sensor."""
    design = matt_design(0.5)
    steep = known_press.known_sensor(
        replace(design, membrane=replace(design.membrane, decay_length_mm=decay_mm))
    )
    return steep, known_press.on(steep, CylinderIndenter(5.0, 1.0), x_mm=0.5, y_mm=0.3)


@pytest.mark.parametrize("effort", ["fast", "best"])
@pytest.mark.parametrize("decay_mm", [0.18, 0.1])
def test_walls_are_right_or_reported_to_be_too_steep(decay_mm, effort):
    """Walls of 80 and 84 degrees."""
    steep, press = steep_press(decay_mm)
    found = Reconstructor(steep.calibration, effort=effort).depth(press.frame, normals=False)
    error_um = rms_um(depth_error(found, press.truth, radius_mm=12.0))
    assert found.findings or error_um < 15.0
    assert ("steep_walls" in {note.key for note in found.findings}) or decay_mm > 0.1


@lru_cache(maxsize=1)
def wide_press(focal_px: float) -> tuple[ExactSensor, ExactPress]:
    """Return a press seen through a wide lens, and its sensor."""
    design = matt_design(0.25)
    camera = replace(design.camera, fx=focal_px, fy=focal_px, distortion=(0.0, 0.0, 0.0, 0.0))
    wide = replace(design.membrane, working_diameter_mm=100.0)
    known = known_press.known_sensor(replace(design, camera=camera, membrane=wide))
    return known, known_press.on(known, BallIndenter(4.0, 1.0), x_mm=1.2, y_mm=-0.8)


@pytest.mark.parametrize(("effort", "focal_px"), [("fast", 80.0), ("best", 40.0)])
def test_wide_lenses_are_right_or_reported_to_see_too_little(focal_px, effort):
    """Rays up to 63 and 76 degrees: wide pixels."""
    known, press = wide_press(focal_px)
    found = Reconstructor(known.calibration, effort=effort).depth(press.frame, normals=False)
    error_um = rms_um(depth_error(found, press.truth, radius_mm=7.0))
    assert found.findings or error_um < 10.0
