"""The scripts of ``tests/studies`` run, and show what the documentation says of them."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gelpolight_core.session.session import read_session
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.simulated_session import session_toml
from gelpolight_core.studies.stability import CaseOutcome, run_case
from tests.studies import ablation, extreme_sessions, integrators, rivals, stated_deviations
from tests.studies.point_light import rows
from tests.studies.presses import show, true_presses


def test_terms_are_worth_what_they_correct(virtual_session, virtual_results, capsys):
    session = read_session(virtual_session)
    names = ("all terms", "light for depth 0 only", ablation.PAPER, "no glossy lobe")
    rows = list(ablation.ablate(session, virtual_results, true_presses(session, 2), names))
    assert [row["instead"] for row in rows] == list(names)
    assert rows[0]["worth um"] == 0.0
    assert all(row["worth um"] > least for row, least in zip(rows, (-1, 5, 5, 1), strict=True))
    show(rows)
    assert capsys.readouterr().out.splitlines()[1].startswith("all terms,")


def test_no_rival_reaches_the_full_model_and_wrong_eigenvalues_spoil_all(
    virtual_session, virtual_results, virtual_calibration
):
    fits = {"table": rivals.fit_table, "polynomial": rivals.fit_polynomial}
    presses = true_presses(read_session(virtual_session), 2)
    rows = rivals.compare(virtual_calibration, virtual_results, presses, fits)
    um = {row["method"]: row["RMS um"] for row in rows}
    assert um["full"] < min(um["table"], um["polynomial"]) < 100.0
    for name in fits:
        assert um[f"{name}, wrong eigenvalues"] > um[name]


def test_the_network_learns_a_smooth_function_by_the_right_gradients():
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
        ("sine transform, 4 slopes an edge (ours, live)", 4.0),
        ("weighted conjugate gradients (ours, best)", 4.0),
    ],
)
def test_integrators_converge_as_their_stencils_say(name, expected):
    assert integrators.order(name, (40, 80, 120)) == pytest.approx(expected, abs=0.15)


def test_only_weighted_integration_is_right_where_the_border_cuts_the_contact():
    cut = integrators.scene(120, integrators.CUT_MM)
    um = {name: integrators.error_um(name, cut) for name in integrators.INTEGRATORS}
    assert um.pop("weighted conjugate gradients (ours, best)") < 0.2 < 20.0 < min(um.values())


def test_stated_uncertainties_hold_the_truth_with_lengths_stated_wrongly(tmp_path):
    found = list(stated_deviations.measured(0, tmp_path / "session", 2, 3, 0.25))
    assert len(found) == 12
    rows = {row["what"]: row for row in stated_deviations.table(found)}
    assert list(rows)[:2] == ["cylinder size", "cylinder height"]
    assert rows["all"]["n"] == 12 and rows["all"]["held %"] >= 80.0
    # The objects of a sensor are the same with each calibration, and the budget is complete.
    height = rows["cylinder height"]
    assert height["n"] == 2 and height["between um"] > 0.0
    parts = [height[f"{part} um"] for part in ("noise", "calibration", "model", "fit")]
    assert float(np.linalg.norm(parts)) == pytest.approx(height["sd um"])


def test_each_method_is_right_under_its_own_light():
    point, directional = rows(SensorDesign(), height_shares=(1.0,), elevations_deg=(45.0,))
    assert point.near_um is not None and point.directional_um is not None
    assert directional.near_um is not None and directional.directional_um is not None
    assert point.near_um < 12.0 < 5.0 * point.near_um < point.directional_um
    assert directional.directional_um < 15.0 < 3.0 * directional.directional_um
    assert 3.0 * directional.directional_um < directional.near_um


def test_a_sensor_that_is_calibrated_from_small_images_is_measured_in_every_mode(monkeypatch):
    fewer = replace(SensorDesign(), balls=SensorDesign().balls[:5])
    monkeypatch.setattr(extreme_sessions, "SensorDesign", lambda: fewer)
    cases = extreme_sessions.session_cases()
    result = run_case(next(c for c in cases if c.name == "session_scale_0.125"))
    assert result.outcome is not CaseOutcome.FAILED, result.message
    assert len(result.seen.modes) == 4


def test_each_stated_length_is_stated_wrongly_alone(tmp_path):
    path, before = tmp_path / "session.toml", session_toml(SensorDesign())
    for length in extreme_sessions.LENGTHS:
        path.write_text(before)
        extreme_sessions.state_wrongly(length, 5.0, tmp_path)
        lines = zip(before.splitlines(), path.read_text().splitlines(), strict=True)
        changed = [
            [float(line.split("=")[1]) for line in pair] for pair in lines if len({*pair}) > 1
        ]
        assert len(changed) == (len(SensorDesign().balls) if "ball" in length else 1)
        assert all(new == pytest.approx(1.05 * old, rel=1e-4) for old, new in changed)
