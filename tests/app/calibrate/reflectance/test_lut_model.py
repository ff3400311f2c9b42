"""The model of the curve editor: every edit gives a valid reflectance table."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.calibrate.reflectance import lut_model as model
from app.calibrate.reflectance.lut_model import CurveEdit
from gelpolight_core.calibration.scatter import ReflectanceScatter
from gelpolight_core.channels import CHANNEL_KEYS
from gelpolight_core.errors import InputError
from gelpolight_core.reflectance.table import ReflectanceTable, fit_channel

CHANNEL = st.integers(0, 2)
SHARE = st.floats(0.0, 1.0)


@cache
def scatter() -> ReflectanceScatter:
    """Return points near cos^1.3 and some dirt that is too bright, in every channel."""
    random = np.random.default_rng(3)
    cosines = random.uniform(0.15, 1.0, 9000)
    values = 0.05 + 0.9 * cosines**1.3 * (1.0 + 0.02 * random.standard_normal(cosines.size))
    dirt = (cosines > 0.5) & (cosines < 0.6) & (random.uniform(size=cosines.size) < 0.8)
    values = np.where(dirt, values + 0.25, values)
    presses = np.zeros(cosines.size, dtype=np.intp)
    return ReflectanceScatter(
        (cosines, cosines, cosines), (values, values, values), (presses,) * 3, ("balls/a.png",)
    )


@cache
def start() -> CurveEdit:
    """Return the initial state of the editor for the fit to the scatter."""
    s = scatter()
    fits = [fit_channel(s.cosines[k], s.values[k], name=CHANNEL_KEYS[k]) for k in range(3)]
    table = ReflectanceTable(
        tuple(f.cosines for f in fits),  # type: ignore[arg-type]
        tuple(f.values for f in fits),  # type: ignore[arg-type]
        np.array([f.coverage for f in fits]),
    )
    return model.start_edit(table)


def index_of(edit: CurveEdit, channel: int, share: float) -> int:
    """Return a node index by the share of nodes before it."""
    return min(int(share * len(edit[channel].curve.cosines)), len(edit[channel].curve.cosines) - 1)


OPERATIONS = st.one_of(
    st.tuples(st.just("move"), CHANNEL, SHARE, st.floats(-2.0, 3.0), st.floats(-5.0, 5.0)),
    st.tuples(st.just("add"), CHANNEL, SHARE),
    st.tuples(st.just("remove"), CHANNEL, SHARE),
    st.tuples(st.just("snap"), CHANNEL, SHARE),
    st.tuples(st.just("snap all"), CHANNEL),
    st.tuples(st.just("smooth"), CHANNEL),
    st.tuples(st.just("thin"), CHANNEL),
    st.tuples(st.just("reset"), CHANNEL),
)


def apply(edit: CurveEdit, operation: tuple) -> CurveEdit:
    """Apply an edit; a rejected one leaves the state unchanged."""
    kind, channel, *rest = operation
    try:
        match kind:
            case "move":
                return model.move_node(edit, channel, index_of(edit, channel, rest[0]), *rest[1:])
            case "add":
                return model.add_node(edit, channel, rest[0])[0]
            case "remove":
                return model.remove_node(edit, channel, index_of(edit, channel, rest[0]))
            case "snap":
                return model.snap_to_fit(edit, channel, index_of(edit, channel, rest[0]))
            case "snap all":
                return model.snap_to_fit(edit, channel)
            case "smooth":
                return model.smooth(edit, channel)
            case "thin":
                return model.thin_nodes(edit, channel)
            case _:
                return model.reset_channel(edit, channel, start())
    except InputError:
        return edit


@given(st.lists(OPERATIONS, max_size=40))
def test_every_edit_keeps_the_table_invertible(operations: list[tuple]) -> None:
    edit = start()
    for operation in operations:
        edit = apply(edit, operation)
    table = model.table_of(edit)
    cosine = np.linspace(0.0, 1.0, 50)
    for k in range(3):
        assert np.all(np.diff(table.cosines[k]) > 0.0)
        assert np.all(np.diff(table.values[k]) > 0.0)
        there_and_back = table.cosine(k, table.response(k, np.array(table.cosines[k])))
        np.testing.assert_allclose(there_and_back, table.cosines[k], atol=1e-6)
        assert np.all(np.diff(table.response(k, cosine)) >= 0.0)
    table.lookup(512)


@given(OPERATIONS, OPERATIONS)
def test_an_edit_changes_neither_the_old_state_nor_other_channels(
    first: tuple, second: tuple
) -> None:
    before = apply(start(), first)
    text = repr(before)
    after = apply(before, second)
    assert repr(before) == text
    for k in range(3):
        if k != second[1]:
            assert after[k] is before[k]


def test_an_unedited_table_is_returned_unchanged() -> None:
    assert model.start_edit(model.table_of(start())) == start()


@given(SHARE, st.floats(-1.0, 2.0), st.floats(-1.0, 2.0))
def test_a_dragged_node_stays_between_its_neighbours(
    share: float, cosine: float, value: float
) -> None:
    index = index_of(start(), 0, share)
    old = start()[0].curve
    new = model.move_node(start(), 0, index, cosine, value)[0].curve
    for name in ("cosines", "values"):
        before, after = list(getattr(old, name)), list(getattr(new, name))
        moved = after.pop(index)
        before.pop(index)
        assert after == before
        if 0 < index < len(after):
            assert after[index - 1] < moved < after[index]


@given(st.floats(0.02, 0.98))
def test_an_added_node_hardly_changes_the_curve_and_can_be_removed(cosine: float) -> None:
    thin = model.thin_nodes(start(), 0)
    try:
        more, index = model.add_node(thin, 0, cosine)
    except InputError:
        assert np.abs(np.array(thin[0].curve.cosines) - cosine).min() < model.LEAST_GAP
        return
    assert more[0].curve.cosines[index] == cosine
    assert more[0].curve.values[index] == pytest.approx(float(thin[0].curve.at(cosine)))
    assert model.remove_node(more, 0, index) == thin


def test_end_nodes_and_the_last_nodes_cannot_be_removed() -> None:
    edit = start()
    with pytest.raises(InputError, match="end nodes"):
        model.remove_node(edit, 0, 0)
    while len(edit[0].curve.cosines) > model.LEAST_NODES:
        edit = model.remove_node(edit, 0, 1)
    with pytest.raises(InputError, match="at least 4 nodes"):
        model.remove_node(edit, 0, 1)


def test_excluded_points_no_longer_bend_the_curve() -> None:
    true = 0.05 + 0.9 * 0.55**1.3
    # The fit goes through the dirt, which has more points than the membrane.
    assert start()[0].curve.at(0.55) > true + 0.1
    outline = [(0.48, 0.62), (0.62, 0.75), (0.62, 0.95), (0.48, 0.8)]
    edit = model.leave_out(start(), 0, outline, scatter())
    assert edit[0].curve == edit[0].fit
    assert float(edit[0].curve.at(0.55)) == pytest.approx(true, abs=0.01)
    assert edit[1:] == start()[1:]
    assert model.reset_channel(edit, 0, start()) == start()


def test_an_outline_around_all_points_is_rejected() -> None:
    with pytest.raises(InputError, match="usable pixels"):
        model.leave_out(start(), 0, [(-1, -1), (2, -1), (2, 2), (-1, 2)], scatter())


@given(st.integers(3, 9), st.floats(0.05, 0.4), st.floats(0.3, 0.7), st.floats(0.3, 0.7))
def test_an_outline_contains_the_points_inside_it(
    n: int, radius: float, x: float, y: float
) -> None:
    """A regular polygon: points nearer than its sides are inside, others outside."""
    angle = 2.0 * np.pi * np.arange(n) / n
    outline = tuple(zip(x + radius * np.cos(angle), y + radius * np.sin(angle), strict=True))
    out = model.left_out_points((outline,), scatter(), 0)
    away = np.hypot(scatter().cosines[0] - x, scatter().values[0] - y)
    assert out[away < 0.999 * radius * np.cos(np.pi / n)].all()
    assert not out[away > 1.001 * radius].any()
