"""The model of the curve editor: every edit gives a valid reflectance table."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.calibrate.reflectance import lut_model as model
from app.calibrate.reflectance.lut_model import Curve
from gelpolight_core.calibration.scatter import ReflectanceScatter
from gelpolight_core.channels import CHANNEL_KEYS
from gelpolight_core.reflectance.table import ReflectanceTable, fit_channel

SHARE = st.floats(0.0, 1.0)


@cache
def scatter() -> ReflectanceScatter:
    """Return points near cos^1.3 in every channel."""
    random = np.random.default_rng(3)
    cosines = random.uniform(0.15, 1.0, 9000)
    values = 0.05 + 0.9 * cosines**1.3 * (1.0 + 0.02 * random.standard_normal(cosines.size))
    presses = np.zeros(cosines.size, dtype=np.intp)
    return ReflectanceScatter(
        (cosines, cosines, cosines), (values, values, values), (presses,) * 3, ("balls/a.png",)
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


def start() -> Curve:
    """Return the red curve of the fit."""
    return model.fitted_curves(fitted())[0]


def index_of(curve: Curve, share: float) -> int:
    """Return a node index by the share of nodes before it."""
    return min(int(share * len(curve.cosines)), len(curve.cosines) - 1)


OPERATIONS = st.one_of(
    st.tuples(st.just("move"), SHARE, st.floats(-2.0, 3.0), st.floats(-5.0, 5.0)),
    st.tuples(st.just("add"), st.floats(-0.5, 1.5)),
    st.tuples(st.just("remove"), SHARE),
    st.tuples(st.just("smooth")),
    st.tuples(st.just("thin")),
)


def apply(curve: Curve, operation: tuple) -> Curve:
    """Apply an edit."""
    match operation:
        case "move", share, cosine, value:
            return model.move_node(curve, index_of(curve, share), cosine, value)
        case "add", cosine:
            return model.add_node(curve, cosine)[0]
        case "remove", share:
            index = index_of(curve, share)
            possible = model.is_removable(curve, index)
            return model.remove_node(curve, index) if possible else curve
        case ("smooth",):
            return model.smooth(curve)
    return model.thin_nodes(curve)


@given(st.lists(OPERATIONS, max_size=40))
def test_every_edit_keeps_the_table_invertible(operations):
    curve = start()
    for operation in operations:
        curve = apply(curve, operation)
    cosines, values = np.array(curve.cosines), np.array(curve.values)
    assert (cosines[0], cosines[-1]) == (0.0, 1.0) and values[0] >= 0.0
    table = ReflectanceTable((cosines,) * 3, (values,) * 3, fitted().coverage)
    table.check()
    there_and_back = table.cosine(0, table.response(0, cosines))
    np.testing.assert_allclose(there_and_back, cosines, atol=1e-6)
    table.lookup(512)


@given(st.floats(0.02, 0.98))
def test_an_added_node_hardly_changes_the_curve_and_can_be_removed(cosine):
    thin = model.thin_nodes(start())
    more, index = model.add_node(thin, cosine)
    if more == thin:
        assert abs(thin.cosines[index] - cosine) < model.LEAST_GAP
        return
    assert more.cosines[index] == cosine
    assert more.values[index] == pytest.approx(float(thin.at(cosine)))
    assert model.remove_node(more, index) == thin


def test_end_nodes_and_the_last_nodes_cannot_be_removed():
    curve = start()
    assert not model.is_removable(curve, 0)
    while model.is_removable(curve, 1):
        curve = model.remove_node(curve, 1)
    assert len(curve.cosines) == model.LEAST_NODES


def test_stored_nodes_replace_the_curves_of_their_channels_only():
    curves, bent = model.fitted_curves(fitted()), model.smooth(start())
    changed = model.with_nodes(curves, {1: bent.points})
    assert changed == (curves[0], bent, curves[2])
