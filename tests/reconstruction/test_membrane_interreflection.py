"""Shadows and normals of a surface that the rounds have found, against geometry."""

import numpy as np
import pytest

from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.reconstruction.near_light.kernel_structures import HIDDEN, JUDGED, RatioImage
from gelpolight_core.reconstruction.near_light.membrane_interreflection import (
    CLEAR,
    shadow_clearance,
    with_interreflection,
)

NODES, PITCH = 120, 0.1
AXIS = (PITCH * (np.arange(NODES) - NODES / 2)).astype(np.float32)
LEDS = np.array([[0.0, 10.0, -10.0], [-9.0, -5.0, -10.0], [9.0, -5.0, -10.0]], np.float32)


def test_a_plateau_hides_the_light_behind_it_as_far_as_its_shadow_reaches():
    height = 0.8
    ridge = np.where(np.abs(AXIS) < 1.0, height, 0.0).astype(np.float32)
    depth = np.ascontiguousarray(np.repeat(ridge[:, None], NODES, axis=1))
    x, y = np.meshgrid(AXIS, AXIS)
    points = np.stack([x, y, -depth], axis=-1).astype(np.float32)
    clear = shadow_clearance(
        points, depth, (AXIS[0], AXIS[0], np.float32(PITCH)), LEDS, RowThreadPool(1)
    )
    # The first LED is at y = 10 and 10 deep: at the ridge's edge, y = -1, its rays rise by
    # (10 - 0.8) / 11 of their way, so that the shadow ends 0.8 * 11 / 9.2 mm behind it.
    ends = -1.0 - height * 11.0 / (10.0 - height)
    hidden = clear[0, :, NODES // 2] < CLEAR
    behind = (AXIS < -1.0 - PITCH) & (AXIS > ends + PITCH)
    assert hidden[behind].all()
    assert not hidden[(AXIS < ends - PITCH) | (AXIS > 1.0 + PITCH)].any()
    assert not hidden[np.abs(AXIS) < 1.0 - PITCH].any()


def test_an_image_gets_what_is_hidden_and_what_comes_from_around():
    ratio = np.ones((3, 8, 8), np.float32)
    marks = np.full((8, 8), 1, np.uint8)
    around, clear = np.full((3, 4, 4), 0.2, np.float32), np.ones((3, 4, 4), np.float32)
    clear[1, :2] = -1.0
    coarse = RatioImage(*(np.ones((3, 4, 4), np.float32),) * 3, marks[::2, ::2])
    found = with_interreflection(RatioImage(ratio, ratio, ratio, marks), coarse, around, clear)
    assert found.around == pytest.approx(np.full_like(ratio, 0.2))
    assert (found.marks & 1).all() and (found.marks & JUDGED).all()
    assert ((found.marks[:3] & (HIDDEN << 1)) > 0).all()
    assert not (found.marks[5:] & (HIDDEN << 1)).any()
    assert not (found.marks & (HIDDEN | HIDDEN << 2)).any()


def test_light_from_around_jumps_where_the_image_jumps():
    """A wall begins in the middle of a coarse node: bilinear values would smear its light."""
    wall = np.arange(64) >= 30
    fine = np.where(wall, np.array([[0.4], [1.4], [0.9]]), 1.0)[:, None, :].repeat(32, axis=1)
    light = np.where(wall, 0.35, 0.02)[None, None, :].repeat(32, axis=1).repeat(3, axis=0)
    means = [m.reshape(3, 8, 4, 16, 4).mean((2, 4)).astype(np.float32) for m in (fine, light)]
    marks = np.zeros((32, 64), np.uint8)
    image = RatioImage(*(fine.astype(np.float32),) * 3, marks)
    coarse = RatioImage(*(means[0],) * 3, marks[::4, ::4])
    found = with_interreflection(image, coarse, means[1], np.ones_like(means[1])).around
    assert found == pytest.approx(light, abs=0.02)
