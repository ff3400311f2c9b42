"""The model of the curve editor: every edit gives a valid reflectance table."""

from functools import cache

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from app.calibrate.reflectance import lut_model as model
from app.calibrate.reflectance.lut_model import ReflectanceCurve
from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.calibration.reflectance_scatter import ReflectanceScatter
from gelpolight_core.light.reflectance_table import ReflectanceTable, fit_channel

SHARE = st.floats(0.0, 1.0)


@cache
def scatter() -> ReflectanceScatter:
    """Return points near cos^1.3 in every channel."""
    random = np.random.default_rng(3)
    cosines = random.uniform(0.15, 1.0, 9000)
    values = 0.05 + 0.9 * cosines**1.3 * (1.0 + 0.02 * random.standard_normal(cosines.size))
    return ReflectanceScatter(
        (cosines, cosines, cosines), (values, values, values), ("balls/a.png",)
    )


@cache
def fitted() -> ReflectanceTable:
    """Return the fit to the scatter."""
    s = scatter()
    fits = [fit_channel(s.cosines[k], s.values[k], name=CHANNEL_KEYS[k]) for k in range(3)]
    return ReflectanceTable(
        tuple(f.cosines for f in fits),  # type: ignore[arg-type]
        tuple(f.values for f in fits),  # type: ignore[arg-type]
        np.array([f.coverage for f in fits]),
    )


def start() -> ReflectanceCurve:
    """Return the red curve of the fit."""
    return model.fitted_curves(fitted())[0]


def index_of(curve: ReflectanceCurve, share: float) -> int:
    """Return a node index by the share of nodes before it."""
    return min(int(share * len(curve.cosines)), len(curve.cosines) - 1)


MOVES = st.tuples(SHARE, st.floats(-2.0, 3.0), st.floats(-5.0, 5.0))


@given(st.lists(MOVES, max_size=40))
def test_every_edit_keeps_the_table_invertible(moves):
    curve = start()
    for share, cosine, value in moves:
        curve = model.move_node(curve, index_of(curve, share), cosine, value)
    cosines, values = np.array(curve.cosines), np.array(curve.values)
    assert (cosines[0], cosines[-1]) == (0.0, 1.0) and values[0] >= 0.0
    table = ReflectanceTable((cosines,) * 3, (values,) * 3, fitted().coverage)
    table.check()
    there_and_back = table.cosine(0, table.response(0, cosines))
    np.testing.assert_allclose(there_and_back, cosines, atol=1e-6)
    table.lookup()


def test_few_nodes_draw_the_fit():
    table, curve = fitted(), start()
    assert len(curve.points) < 0.5 * len(table.cosines[0])
    off = np.abs(curve.at(table.cosines[0]) - table.values[0])
    assert off.max() <= model.TOLERANCE * table.values[0][-1]


def test_stored_nodes_replace_the_curves_of_their_channels_only():
    curves = model.fitted_curves(fitted())
    bent = model.move_node(start(), 2, 0.5, 5.0)
    changed = model.with_nodes(curves, {1: bent.points})
    assert changed == (curves[0], bent, curves[2])
    assert model.edited_nodes(changed, curves) == {1: bent.points}
