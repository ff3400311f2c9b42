"""Where the error of a press comes from: the true surface, light gathered over it, the command."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import numpy as np
import pytest

from app.command_line.main import MENDABLE, main
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.experiments.explain import explain
from gelpolight_core.experiments.true_view import lit_by, true_view
from gelpolight_core.measurement.score import TrueDepth
from gelpolight_core.reflectance.gathered_light import Receivers, Surface, gathered
from gelpolight_core.reflectance.membrane import Membrane
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.session import read_session

PRESS = "cylinder_s5_d100.png"
LEDS = np.array([[0.0, 10.0, -10.0], [-9.0, -5.0, -10.0], [9.0, -5.0, -10.0]])


@pytest.fixture(scope="module")
def one_press(virtual_session: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the virtual session's folder with one press and its truth."""
    folder = tmp_path_factory.mktemp("explain") / "one"
    (folder / "presses").mkdir(parents=True)
    (folder / "truth").mkdir()
    shutil.copy(virtual_session / "session.toml", folder)
    shutil.copy(virtual_session / "presses" / PRESS, folder / "presses")
    shutil.copy((virtual_session / "truth" / PRESS).with_suffix(".npz"), folder / "truth")
    rows = (virtual_session / "presses" / "truth.csv").read_text().splitlines()
    kept = [row for row in rows if row.startswith(("file", PRESS))]
    (folder / "presses" / "truth.csv").write_text("\n".join(kept))
    return folder


def test_rays_meet_a_slanted_plane_where_geometry_says() -> None:
    axis = np.linspace(-3.0, 3.0, 121)
    truth = TrueDepth(np.tile(1.0 + 0.2 * axis, (121, 1)), axis, axis)
    at = np.linspace(-1.0, 1.0, 9)
    view = true_view(truth, at, at, np.full((9, 9, 2), 0.3))
    # d = 1 + 0.2 (x + 0.3 d)
    assert view.depth_mm == pytest.approx(np.tile((1.0 + 0.2 * at) / 0.94, (9, 1)), abs=1e-4)
    normal = np.array([-0.2, 0.0, -1.0]) / np.hypot(0.2, 1.0)
    assert view.normals == pytest.approx(np.broadcast_to(normal, (9, 9, 3)), abs=1e-6)
    assert view.known.all() and lit_by(truth, view, LEDS).all()


def test_a_plateau_casts_its_shadow_away_from_the_light() -> None:
    axis = np.linspace(-4.0, 4.0, 161)
    depth = np.where(np.abs(axis) < 1.0, 1.0, 0.0)
    truth = TrueDepth(np.tile(depth[:, None], (1, 161)), axis, axis)
    at = np.array([-3.0, -1.4, 1.4, 3.0])
    lit = lit_by(truth, true_view(truth, np.array([0.0, 0.1]), at, np.zeros((4, 2, 2))), LEDS)
    # The first LED is at y = 10 and as high: its shadow is about 1 mm long.
    assert lit[:, 0].tolist() == [
        [True, True, True],
        [False, True, True],
        [True, False, False],
        [True, True, True],
    ]


def test_a_tilted_facet_sees_its_share_of_an_even_ground() -> None:
    """A plane element tilted by tau against an even ground sees (1 - cos tau) / 2 of it.

    The field ends about 14 mm away, so that it lacks a strip below the horizon.
    """
    nodes, side, tilt, above = 256, 0.1, np.radians(50.0), 0.4
    axis = side * (np.arange(nodes) - nodes / 2)
    points = np.zeros((nodes, nodes, 3))
    points[..., 0], points[..., 1] = np.meshgrid(axis, axis)
    normals, view = np.zeros_like(points), np.zeros_like(points)
    normals[..., 2] = view[..., 2] = -1.0
    middle = np.s_[nodes // 2, nodes // 2]
    points[middle][2], normals[middle] = -above, [np.sin(tilt), 0.0, -np.cos(tilt)]
    where = np.zeros((nodes, nodes), bool)
    where[middle] = True
    surface = Surface(points, normals, view, np.full_like(points, 0.2))
    found = gathered(surface, Receivers.on(surface, where), LEDS, Membrane(), side)
    share = 0.5 - 0.5 * np.cos(tilt) - 2.0 / np.pi * np.sin(tilt) * above / 14.0
    assert found[0] / 0.2 == pytest.approx(np.full(3, share), rel=0.02)


def test_the_virtual_sensors_light_is_direct(
    one_press: Path, virtual_calibration: Calibration
) -> None:
    found = explain(virtual_calibration, read_session(one_press))
    # It is simulated without interreflection, and integration loses next to nothing.
    assert found.reflectance_needed == pytest.approx(0.0, abs=0.2)
    assert found.reflectance_seen > 0.3
    (loss,) = found.losses
    assert abs(loss.true_slopes) < 0.3
    assert abs(loss.found) < 4.0
    lit = [row for row in found.light if row.side != "dark"]
    assert len(lit) > 6
    assert max(abs(row.left) for row in lit) < 0.06


def test_the_command_prints_and_writes_the_tables(
    one_press: Path,
    virtual_calibration: Calibration,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file, out = tmp_path / "c.gplcal", tmp_path / "out"
    write_calibration(virtual_calibration, file)
    assert main(["explain", str(file), str(one_press), "-o", str(out)]) == 0
    assert PRESS in capsys.readouterr().out
    with (out / "light.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert {"towards", "away"} <= {row["side"] for row in rows}
    assert len((out / "height.csv").read_text().splitlines()) == 2
    (one_press / "truth" / PRESS).with_suffix(".npz").unlink()
    assert main(["explain", str(file), str(one_press)]) == MENDABLE
