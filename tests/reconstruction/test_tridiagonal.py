"""The tridiagonal half of the Poisson solve, and its threads."""

import gc
import threading

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.reconstruction.integration.poisson import PoissonSolver
from gelpolight_core.reconstruction.integration.tridiagonal import (
    BLOCK,
    settled_rows,
    solve_columns,
)


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 400), st.integers(1, 140), st.booleans(), st.integers(0, 2**32 - 1))
def test_columns_are_solved_as_a_banded_solver_does(rows, columns, single, seed):
    dtype = np.dtype(np.float32 if single else np.float64)
    field = np.random.default_rng(seed).normal(size=(rows, columns)).astype(dtype)
    waves = 4.0 * np.sin(np.pi * np.arange(1, columns + 1) / (2 * columns)) ** 2
    waves[0] *= 0.01
    found = field.copy()
    settled = settled_rows(waves, rows, dtype)
    solve_columns(0, len(settled), found, waves, settled, 2.0)
    for j in {0, columns // 2, min(BLOCK, columns - 1), columns - 1}:
        middle = np.full(rows, 2.0 + waves[j])
        middle[0] += 1.0
        middle[-1] += 1.0
        around = np.full(rows, -1.0)
        bands = np.stack([around, middle, around])
        expected = scipy.linalg.solve_banded((1, 1), bands, 2.0 * field[:, j].astype(np.float64))
        # The system magnifies a rounding by the square of its length, in the banded solver too.
        allowed = (4e-6 if single else 1e-10) * np.abs(expected).max()
        assert np.abs(found[:, j] - expected).max() <= allowed


@pytest.mark.parametrize("owner", [RowThreadPool, lambda n: PoissonSolver(90, 80, pitch_mm=0.1)])
def test_threads_end_with_their_owner(owner):
    before = set(threading.enumerate())
    kept = owner(2)
    if isinstance(kept, RowThreadPool):
        kept.run(100, lambda first, last: None)
    else:
        kept.integrate(*np.zeros((2, 90, 80), np.float32))
    started = set(threading.enumerate()) - before
    assert started
    del kept
    gc.collect()
    for thread in started:
        thread.join(60.0)
        assert not thread.is_alive()
