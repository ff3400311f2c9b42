"""The scripts beside this file run, and show what the documentation says of them."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from gelpolight_core.calibration.recipe import Results
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.session import read_session
from tests.studies import ablation, coverage, explain, integrators, rivals
from tests.studies.presses import show, true_presses


def test_terms_are_worth_what_they_correct(
    virtual_session: Path, virtual_results: Results, capsys: pytest.CaptureFixture[str]
) -> None:
    session = read_session(virtual_session)
    names = ("all terms", "light for depth 0 only", ablation.PAPER, "no glossy lobe")
    rows = list(ablation.ablate(session, virtual_results, true_presses(session, 2), names))
    assert [row["instead"] for row in rows] == list(names)
    assert rows[0]["worth um"] == 0.0
    assert all(row["worth um"] > least for row, least in zip(rows, (-1, 5, 5, 1), strict=True))
    show(rows)
    assert capsys.readouterr().out.splitlines()[1].startswith("all terms,")


def test_the_virtual_sensors_light_is_direct_and_integration_loses_next_to_nothing(
    virtual_session: Path, virtual_calibration: Calibration
) -> None:
    presses = true_presses(read_session(virtual_session), 1)
    (loss,), lights, needed, measured = explain.explain(virtual_calibration, presses)
    # It is simulated without interreflection.
    assert needed == pytest.approx(0.0, abs=0.2) and measured > 0.3
    assert abs(loss["all slopes true"]) < 0.3 and abs(loss["height %"]) < 4.0
    lit = [row for row in lights if row["side"] != "dark"]
    assert len(lit) > 6 and max(abs(row["image"] - row["direct"]) for row in lit) < 0.06


def test_no_rival_reaches_the_full_model_and_wrong_eigenvalues_spoil_all(
    virtual_session: Path, virtual_results: Results, virtual_calibration: Calibration
) -> None:
    fits = {"table": rivals.fit_table, "polynomial": rivals.fit_polynomial}
    presses = true_presses(read_session(virtual_session), 2)
    rows = rivals.compare(virtual_calibration, virtual_results, presses, fits)
    um = {row["method"]: row["RMS um"] for row in rows}
    assert um["full"] < min(um["table"], um["polynomial"]) < 100.0
    for name in fits:
        assert um[f"{name}, wrong eigenvalues"] > um[name]


def test_the_network_learns_a_smooth_function_by_the_right_gradients() -> None:
    rng = np.random.default_rng(0)
    change = rng.uniform(-0.5, 0.5, (12_000, 3)).astype(np.float32)
    place = rng.uniform(-8.0, 8.0, (12_000, 2)).astype(np.float32)
    slopes = np.stack([0.7 * change[:, 0] + 0.01 * place[:, 0], change[:, 1] ** 2], axis=1)
    samples = rivals.Samples(change, place, slopes, np.zeros(12_000))
    found = rivals.fit_network(samples, steps=1200)(change, place)
    assert np.sqrt(np.mean((found - slopes) ** 2)) < 0.12 * slopes.std()
    layers = [part for a, b in pairwise((5, 4, 2)) for part in (rng.random((a, b)), rng.random(b))]
    inputs, wanted = rng.standard_normal((7, 5)), rng.standard_normal((7, 2))
    gradient = rivals._gradients(layers, inputs, wanted)[0][0, 0]

    def error(by: float) -> float:
        moved = [layers[0] + by * (np.arange(20).reshape(5, 4) == 0), *layers[1:]]
        return float(((rivals._values(moved, inputs)[-1] - wanted) ** 2).sum() / len(inputs))

    assert gradient == pytest.approx((error(1e-6) - error(-1e-6)) / 2e-6, rel=1e-4)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("sine transform, forward differences", 1.0),
        ("sine transform, trapezoid", 2.0),
        ("cosine transform, Neumann", 2.0),
        ("sine transform, 4 slopes an edge (ours, live)", 4.0),
        ("weighted conjugate gradients (ours, best)", 4.0),
    ],
)
def test_integrators_converge_as_their_stencils_say(name: str, expected: float) -> None:
    assert integrators.order(name, (40, 80, 120)) == pytest.approx(expected, abs=0.15)


def test_ours_is_never_worse_than_the_best_where_slopes_are_lost_or_cut() -> None:
    rows = {row["integrator"]: row for row in integrators.compare(120, 1)}
    ours = rows.pop("weighted conjugate gradients (ours, best)")
    for name in ("holes um", "noise um"):
        assert ours[name] < 1.05 * min(row[name] for row in rows.values())
    assert ours["cut um"] < 0.2 < rows["Frankot-Chellappa"]["cut um"]


def test_the_other_least_squares_are_what_they_claim() -> None:
    made = integrators.scene("free form", 60)
    slopes = made.slope_x, made.slope_y, made.pitch_mm
    difference = integrators.cosine_transform(*slopes) - integrators.sparse_quadratic(made)
    assert np.ptp(difference) < 1e-6
    wave = np.sin(2.0 * np.pi * np.arange(64) / 64)
    slope = np.tile(2.0 * np.pi / 6.4 * np.cos(2.0 * np.pi * np.arange(64) / 64), (64, 1))
    found = integrators.frankot_chellappa(slope, np.zeros_like(slope), 0.1)
    assert found[5] == pytest.approx(wave, abs=1e-9)


def test_stated_uncertainties_hold_the_truth_with_lengths_stated_wrongly(tmp_path: Path) -> None:
    found = list(coverage.measured(0, tmp_path / "session", 2, 3, 0.25))
    assert len(found) == 12
    rows = {row["what"]: row for row in coverage.table(found)}
    assert list(rows)[:2] == ["cylinder size", "cylinder height"]
    assert rows["all"]["n"] == 12 and rows["all"]["held %"] >= 80.0
    # The objects of a sensor are the same with each calibration, and the budget is complete.
    height = rows["cylinder height"]
    assert height["n"] == 2 and height["between um"] > 0.0
    parts = [height[f"{part} um"] for part in ("noise", "calibration", "model", "fit")]
    assert float(np.linalg.norm(parts)) == pytest.approx(height["sd um"])
