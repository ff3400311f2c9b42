"""What a fit explains of a depth map, against the map it was made from."""

import numpy as np
import pytest

from gelpolight_core.measurement.fit_residual import fit_residual, fitted_depth
from gelpolight_core.measurement.indenter_models import MODELS
from gelpolight_core.measurement.object_measurement import measure_heightmap
from tests.measurement.maps import X, Y, made

PLACE = {"x_mm": 1.2, "y_mm": -0.7, "height_mm": 0.8, "drape_decay_mm": 0.6}
EDGE = {"edge_radius_mm": 0.08, "blur_mm2": 0.0}
OBJECTS = {
    "cylinder": {**PLACE, **EDGE, "diameter_mm": 4.0},
    "cuboid": {
        **PLACE,
        **EDGE,
        "side_a_mm": 5.0,
        "side_b_mm": 3.0,
        "yaw": 0.4,
    },
    "ball": {**PLACE, "diameter_mm": 8.0, "blur_mm2": 0.0},
}


@pytest.mark.parametrize("shape", OBJECTS)
def test_the_fitted_depth_is_the_map_that_was_measured(shape):
    heightmap = made(lambda x, y: MODELS[shape].depth(OBJECTS[shape], x, y))
    measurement = measure_heightmap(heightmap, shape=shape)
    x, y = np.meshgrid(X, Y)
    near = np.hypot(x - PLACE["x_mm"], y - PLACE["y_mm"]) < 4.0
    depth = fitted_depth(measurement, x, y)
    assert np.abs(depth - heightmap.depth_mm)[near].max() < 0.02
    assert np.sqrt(np.mean((depth - heightmap.depth_mm)[near] ** 2)) < 0.003


@pytest.mark.function("See what the fit does not explain")
def test_the_residual_shows_what_the_fit_does_not_explain():
    def marked(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        depth = MODELS["cylinder"].depth(OBJECTS["cylinder"], x, y)
        return depth + 0.1 * (np.hypot(x - 1.7, y + 1.2) < 0.3)

    heightmap = made(marked)
    residual = fit_residual(heightmap, measure_heightmap(heightmap, shape="cylinder"))
    x, y = np.meshgrid(X, Y)
    assert np.median(residual[np.hypot(x - 1.7, y + 1.2) < 0.2]) == pytest.approx(0.1, abs=0.02)
    assert abs(np.median(residual[np.hypot(x - 0.2, y + 0.2) < 0.5])) < 0.01
    # Farther than 3 mm from the object there is no residual.
    assert np.isnan(residual[np.hypot(x - 1.2, y + 0.7) > 8.0]).all()
    assert np.isfinite(residual).any() and np.isnan(residual[heightmap.flags != 0]).all()
