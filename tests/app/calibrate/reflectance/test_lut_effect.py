"""The effect of an edited reflectance table on a real press."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.calibrate.reflectance import lut_model as model
from app.calibrate.reflectance.lut_effect import ball_effect
from gelpolight_core.calibration.pipeline import CalibrationRun
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.images import read_image
from gelpolight_core.session.session import read_session


def test_an_unedited_table_gives_the_papers_depth_of_the_ball(
    virtual_run: CalibrationRun, virtual_session: Path
) -> None:
    session = read_session(virtual_session)
    effect = ball_effect(virtual_run, session)
    press = virtual_run.reflectance.presses[0]
    found = effect(model.start_edit(virtual_run.reflectance.table), press.name)
    paper = Reconstructor(virtual_run.calibration, model="paper")
    depth = paper.depth(read_image(session.folder / press.name).rgb).depth_mm
    assert found.profile_mm.max() == pytest.approx(float(depth.max()), rel=0.01)
    # The paper's model is within a few percent of the ball that it was calibrated with.
    assert abs(found.lowest_mm) < 0.1 * press.pose.depth_mm
    assert np.nanmax(found.sphere_mm) == pytest.approx(press.pose.depth_mm, rel=0.01)
    inside = np.isfinite(found.sphere_mm)
    assert np.abs(found.position_mm[inside]).max() == pytest.approx(
        press.contact_radius_mm, abs=0.06
    )
    np.testing.assert_array_equal(np.isfinite(found.residual_mm), inside)


def test_a_wrong_table_changes_the_press(
    virtual_run: CalibrationRun, virtual_session: Path
) -> None:
    effect = ball_effect(virtual_run, read_session(virtual_session))
    start = model.start_edit(virtual_run.reflectance.table)
    name = virtual_run.reflectance.presses[0].name
    bent = model.thin_nodes(start, 0)
    index = int(np.argmin(np.abs(np.subtract(bent[0].curve.cosines, 0.4))))  # on the ball's side
    low, value = bent[0].curve.values[index - 1 : index + 1]
    bent = model.move_node(
        bent, 0, index, bent[0].curve.cosines[index], value - 0.6 * (value - low)
    )
    before, after = effect(start, name), effect(bent, name)
    assert after.rms_mm > 1.5 * before.rms_mm
    # The factors follow the curve, so the membrane far from the ball stays flat.
    assert after.profile_mm[[0, -1]] == pytest.approx(before.profile_mm[[0, -1]], abs=0.06)
