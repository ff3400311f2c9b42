"""An error that all ball radii share is found by the fit of all presses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_joint import BALLS, MIRROR, NO_MAP, SLAB, found_press, pixels_of, truth

from gelpolight_core.calibration.joint import refine_jointly
from gelpolight_core.calibration.refinement import judge_radii
from gelpolight_core.finding import Verdict


@pytest.mark.parametrize(("stated", "verdict"), [(1.0, Verdict.PASS), (1.1, Verdict.FAIL)])
def test_radii_that_are_all_stated_wrong_fail_a_calibration(
    stated: float, verdict: Verdict
) -> None:
    known = truth(gloss=0.3, roughness=0.45, decay_mm=0.6)
    random = np.random.default_rng(0)
    presses = [found_press(pose, random) for pose in BALLS[:4]]
    pixels = [pixels_of(pose, known, 0.01, random) for pose in BALLS[:4]]
    presses = [
        replace(p, pose=replace(p.pose, radius_mm=stated * p.pose.radius_mm)) for p in presses
    ]
    pixels = [replace(p, radius_mm=stated * p.radius_mm) for p in pixels]
    joint = refine_jointly(presses, pixels, MIRROR, SLAB, NO_MAP, check_radii=True)
    assert joint.radius_factor == pytest.approx(1.0 / stated, abs=0.02)
    (figure,) = judge_radii(joint)
    assert figure.verdict is verdict
