"""Real closed sensors, where their images are beside the project; figures by labels of a person."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gelpolight_core.calibration.project import run_calibration
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.session import ClosedSensorSettings, Session, read_session


def real_session(shared_data: Path, name: str) -> Session:
    """Return a real sensor's session, or skip the test."""
    folder = shared_data / "real" / "closed" / name
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there")
    session = read_session(folder)
    return session


def test_a_gelsight_mini_is_calibrated_from_its_balls(shared_data):
    session = real_session(shared_data, "mini-1")
    with (session.folder / "labels.csv").open() as stream:
        labels = [row for row in csv.DictReader(stream) if row["x_px"]]
    kept_back = labels[::6]
    trained = {row["file"] for row in labels[1::6]}
    excluded = frozenset(f"balls/{p.name}" for p in session.files("balls") if p.name not in trained)
    training = replace(session, decisions=replace(session.decisions, excluded=excluded))
    run = run_calibration(training)
    reconstructor, scale = (
        Reconstructor(run.calibration),
        (session.in_place or ClosedSensorSettings()).stated_scale,
    )
    assert isinstance(scale, float)
    errors = []
    for row in kept_back:
        image = session.image(session.folder / "balls" / row["file"])
        found = reconstructor.depth(image.rgb)
        height, width = image.rgb.shape[:2]
        x = (float(row["x_px"]) - 0.5 * (width - 1)) * scale
        y = (float(row["y_px"]) - 0.5 * (height - 1)) * scale
        radius, contact = float(row["ball_radius_mm"]), float(row["r_px"]) * scale
        across, down = np.meshgrid(found.x_mm - x, found.y_mm - y)
        inside = np.hypot(across, down) < 0.9 * contact
        root = np.sqrt(radius**2 - across[inside] ** 2 - down[inside] ** 2)
        wanted = np.stack([across[inside], down[inside], -root], axis=-1) / radius
        cosine = np.clip((wanted * found.normals[inside]).sum(axis=-1), -1.0, 1.0)
        errors.append(float(np.degrees(np.arccos(cosine)).mean()))
    # Labels of 1 to 2 px alone cost 1.5 degrees.
    assert np.mean(errors) < 2.8


@pytest.mark.function("Press a ball on a gel with printed markers")
def test_a_gel_with_printed_markers_runs_from_images_to_depth(shared_data):
    session = real_session(shared_data, "wedge-1")
    some = [path.name for path in session.files("balls")]
    excluded = frozenset(f"balls/{name}" for number, name in enumerate(some) if number % 8)
    run = run_calibration(replace(session, decisions=replace(session.decisions, excluded=excluded)))
    image = session.image(session.folder / "balls" / some[1])
    found = Reconstructor(run.calibration).depth(image.rgb)
    assert np.isfinite(found.depth_mm).all()
    assert found.depth_mm.max() > 0.2
    assert 0.02 < (found.flags != 0).mean() < 0.5
