"""Reflectance factors: an uneven membrane is measured from the background."""

import numpy as np
import scene

from gelpolight_core.base.finding import QualityTable
from gelpolight_core.light.reflectance_table import cosine_table
from gelpolight_core.stages.flat_field.factor_map import calibrate_factors
from gelpolight_core.stages.flat_field.whiteboard_stage import LightIntensityResult


def test_specks_and_slow_changes_are_factors_and_dead_areas_are_not_used():
    table = scene.table()
    points = table.grid.points_mm()
    cosines, radiance = scene.flat_light(points)
    rho = 1.0 + 0.1 * np.sin(points[..., 0])
    rho[100:103, 120:124] = 0.5
    rho[50:60, 100:110] = 0.0
    background = (radiance * cosines * rho[..., None]).astype(np.float32)
    light = LightIntensityResult(
        radiance.astype(np.float32), table.valid, ~table.valid, ~table.valid, QualityTable()
    )
    result = calibrate_factors(background, table, scene.LEDS, light, cosine_table())
    usable = result.usable
    expected = np.broadcast_to(rho[..., None], result.factors.shape)[usable]
    np.testing.assert_allclose(result.factors[usable], expected, rtol=1e-4)
    assert not usable[52:58, 102:108].any()
    assert (result.factors[~usable] == 0).all()
    assert usable[table.valid].mean() > 0.98
