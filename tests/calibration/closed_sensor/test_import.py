"""Calibration folders of other libraries become sessions of closed sensors."""

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from app.cli.main import MENDABLE, main
from gelpolight_core.session.decisions import PlacedCircle
from gelpolight_core.session.session import Session, read_session


@pytest.fixture
def images(closed_session):
    """Return a background and two presses."""
    return [*closed_session.files("background"), *closed_session.files("balls")[:2]]


@pytest.fixture
def catalog(images, tmp_path):
    """Return a folder in the form of gs_sdk."""
    folder = tmp_path / "catalog"
    lines = ["experiment_reldir,diameter(mm)"]
    for number, image in enumerate(images[1:]):
        press = folder / "6.000mm" / str(number)
        press.mkdir(parents=True)
        shutil.copy(image, press / "gelsight.png")
        np.savez(press / "label.npz", center=[100 + number, 90], radius=30)
        lines.append(f"6.000mm/{number},6.000")
    shutil.copy(images[0], folder / "background.png")
    (folder / "catalog.csv").write_text("\n".join(lines) + "\n")
    return folder


def imported(folder: Path, out: Path, *options: str) -> Session:
    """Return the session that the command writes."""
    assert main(["import", str(folder), "-o", str(out), *options]) == 0
    session = read_session(out)
    return session


def refusal(folder: Path, out: Path, capsys: pytest.CaptureFixture[str], *options: str) -> str:
    """Return why the command refuses a folder; it leaves nothing behind."""
    assert main(["import", str(folder), "-o", str(out), *options]) == MENDABLE
    assert not out.exists()
    return capsys.readouterr().err


@pytest.mark.function("Import a calibration folder of another library")
def test_a_catalog_keeps_sizes_images_and_labels(catalog, images, tmp_path):
    session = imported(catalog, tmp_path / "s", "--preset", "gelsight-mini", "--serial", "m")
    assert session.serial == "m"
    assert session.in_place.stated_scale == pytest.approx(0.0634)
    assert session.in_place.mm_per_px_sd == pytest.approx(0.0013)
    first, second = session.files("balls")
    assert first.read_bytes() == images[1].read_bytes()
    assert session.ball_radius_mm(second.name) == 3.0
    assert session.decisions.balls[second.name] == PlacedCircle(101.0, 90.0, 30.0)


def test_a_raster_takes_one_frame_of_each_place_and_states_its_scale(images, tmp_path):
    folder = tmp_path / "raster"
    for name in ("annotations", "blank_images", "probe_images"):
        (folder / name).mkdir(parents=True)
    shutil.copy(images[0], folder / "blank_images" / "blank.png")
    with (folder / "annotations" / "annotations.csv").open("w", newline="") as stream:
        table = csv.writer(stream)
        table.writerow(["img_name", "x_mm", "y_mm", "penetration_depth_mm", "x_px", "y_px"])
        for number, (x, image) in enumerate([(0.0, 1), (0.0, 1), (1.5, 2)]):
            shutil.copy(images[image], folder / "probe_images" / f"{number}_X{x}.png")
            table.writerow([f"{number}_X{x}.png", x, 0.0, 1.0, 90 + x, 80])
    (folder / "annotations" / "metadata.json").write_text(
        json.dumps({"px_per_mm": 20.0, "probe_radius_mm": 2.0})
    )
    session = imported(folder, tmp_path / "s")
    assert session.in_place.stated_scale == pytest.approx(0.05)
    names = [path.name for path in session.files("balls")]
    assert [session.ball_radius_mm(name) for name in names] == [2.0, 2.0]
    assert not session.decisions.balls


def test_a_table_of_circles_needs_ball_and_background(images, tmp_path, capsys):
    folder = tmp_path / "circles"
    (folder / "images").mkdir(parents=True)
    shutil.copy(images[1], folder / "images" / "0001.png")
    (folder / "annotate.csv").write_text("/home/other/images/0001.png,101,110,28\n")
    background = ("--background", str(images[0]))
    scale = ("--mm-per-px", "0.05")
    assert "--background" in refusal(folder, tmp_path / "s", capsys, *scale)
    assert "--ball-diameter" in refusal(folder, tmp_path / "s", capsys, *background, *scale)
    ball = ("--ball-diameter", "6")
    assert "--mm-per-px" in refusal(folder, tmp_path / "s", capsys, *background, *ball)
    session = imported(folder, tmp_path / "s", *background, *ball, *scale)
    assert session.decisions.balls["ball_000.png"] == PlacedCircle(101.0, 110.0, 28.0)
    assert session.ball_radius_mm("ball_000.png") == 3.0


@pytest.mark.parametrize(
    ("line", "output"),
    [
        ("../../etc,6.0", "outside the folder"),
        ("6.000mm/7,6.0", "does not exist"),
        ("6.000mm/0,six", "'six' is not a number"),
        ("6.000mm/0", "too few values"),
    ],
)
def test_a_wrong_line_is_named(catalog, tmp_path, capsys, line, output):
    table = catalog / "catalog.csv"
    table.write_text(table.read_text() + line + "\n")
    message = refusal(catalog, tmp_path / "s", capsys, "--preset", "gelsight-mini")
    assert output in message and "line 4" in message
