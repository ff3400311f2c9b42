"""The numbers on the axes of the 3D view."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from app.views.surface.overlays import axes_marks

BOX = (-13.0, 13.0, -12.0, 12.0, 0.0, 1.8)


def _project(azimuth_deg, elevation_deg, letters_per_mm):
    """Return a parallel projection from a direction."""
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    right = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    up = np.array([-np.sin(azimuth) * np.sin(elevation), np.cos(azimuth) * np.sin(elevation), 0.0])
    up[2] = np.cos(elevation)
    return lambda points: letters_per_mm * points @ np.stack([right, up], axis=1)


def _axes(texts, points):
    """Return the values of each axis with the places of its labels, by its title."""
    axes, first = {}, 0
    for end, text in enumerate(texts):
        if "(mm)" in text:
            axes[text] = np.array([float(t) for t in texts[first:end]]), points[first:end]
            first = end + 1
    return axes


@given(st.floats(-180.0, 180.0), st.floats(0.0, 90.0), st.floats(0.2, 5.0))
def test_numbers_of_an_axis_are_round_even_and_never_cover_each_other(azimuth, elevation, scale):
    project = _project(azimuth, elevation, scale)
    _, points, texts = axes_marks(BOX, 1.0 / 3.0, "depth (mm)", project)
    for values, places in _axes(texts, points).values():
        steps = np.diff(values)
        assert len(values) and np.allclose(steps, steps[:1].repeat(len(steps)))
        apart = np.abs(np.diff(project(places), axis=0))
        # A number of four letters is 2.4 sizes of a letter wide, and 1.2 high.
        assert ((apart[:, 0] > 2.4) | (apart[:, 1] > 1.2)).all()


def test_a_longer_axis_has_more_numbers_and_one_seen_end_on_has_none():
    small, large, flat = (
        _axes(texts, points)
        for direction in ((30.0, 40.0, 0.5), (30.0, 40.0, 4.0), (0.0, 0.0, 2.0))
        for _, points, texts in [axes_marks(BOX, 1.0 / 3.0, "depth (mm)", _project(*direction))]
    )
    assert len(large["x (mm)"][0]) > 2 * len(small["x (mm)"][0])
    assert set(large) == {"x (mm)", "y (mm)", "depth (mm)"} and "y (mm)" not in flat


def test_x_and_y_lie_along_the_lower_edges_of_the_view():
    for azimuth in (20.0, 110.0, 200.0, 290.0):
        project = _project(azimuth, 40.0, 2.0)
        ends, _, _ = axes_marks(BOX, 1.0 / 3.0, "depth (mm)", project)
        middle = project(np.zeros((1, 3)))[0, 1]
        assert (project(ends[:4]).reshape(2, 2, 2).mean(axis=1)[:, 1] < middle).all()
