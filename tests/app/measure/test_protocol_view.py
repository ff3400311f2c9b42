"""The protocol as a technician uses it: mark, automatic capture, interruption, report."""

import csv
import shutil

import numpy as np
import pytest
import scene
from protocol_camera import SceneCamera, image
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QPushButton
from pytestqt.qtbot import QtBot
from report_pdf import report_data

from app.command_line.main import main
from app.measure.press_check import TOLERANCE_MM, PressCheck, make_target
from app.measure.protocol_panel import RunPanel
from app.measure.protocol_press import BenchHand
from app.measure.protocol_view import ProtocolView
from app.services.kept import settings_file
from app.services.preferences import Limits
from app.sources.bench import Bench
from app.sources.source import SourceInfo
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.io.lock import RunLock
from gelpolight_core.measurement.characteristics import LEAST_FLAT
from gelpolight_core.measurement.press import Press
from gelpolight_core.measurement.protocol import Protocol
from gelpolight_core.optics.refraction import camera_to_membrane
from gelpolight_core.reference import Truth

WAIT_MS = 300_000


def frame(position_mm: tuple[float, float] | None, seed: int) -> np.ndarray:
    light = image(scene.calibration(), position_mm)
    noise = np.random.default_rng(seed).standard_normal(light.shape)
    return np.clip(np.rint(255.0 * light + noise), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("shape", ["cylinder", "cuboid"])
def test_the_mark_is_where_the_camera_will_see_the_object(shape):
    calibration = scene.calibration()
    press = Press("p.png", Truth(shape, 4.0, height_mm=1.0), "r01", "1", (3.0, -2.0), 30.0)
    target = make_target(press, calibration)
    seen = np.vstack([target.outline_px, [target.centre_px]])
    data = calibration.data
    back, _ = camera_to_membrane(data.camera.directions(seen), data.plane, data.stack)
    away = np.linalg.norm(back - np.array(press.position_mm), axis=1)
    assert away[-1] == pytest.approx(0.0, abs=1e-6)
    assert away[:-1].min() == pytest.approx(2.0, abs=1e-3)
    widest = 2.0 if shape == "cylinder" else 2.0 * np.sqrt(2.0)
    assert away[:-1].max() == pytest.approx(widest, abs=1e-3)
    assert target.pixels_per_mm == pytest.approx(1.0 / calibration.table.grid.pitch_mm, rel=0.05)


def test_the_live_image_is_followed_from_lifting_to_holding():
    press = Press("p.png", Truth("cylinder", 5.0, height_mm=0.5), "r01", "1", (2.0, 1.0))
    target = make_target(press, scene.calibration())
    check = PressCheck(target, frame(None, 0))
    assert check(frame(press.position_mm, 1)).sentence == "Lift everything off the sensor."
    assert check.phase == "lift"
    assert check(frame(None, 2)).sentence.startswith("Press the object in at the mark")
    beside = (2.0 + 2 * TOLERANCE_MM, 1.0)
    assert "mm from the mark" in check(frame(beside, 3)).sentence
    assert check.phase == "press"
    assert check(frame(press.position_mm, 4)).good and check.phase == "hold"
    assert not check(np.zeros((12, 16, 3), np.uint8)).good


def test_the_bench_presses_once_about_where_it_should():
    bench = Bench(SensorDesign().scaled(0.1))
    hand = BenchHand(bench)
    press = Protocol().presses()[-1]
    hand.press(press)
    scene_ = bench.scene
    assert (scene_.item, scene_.size_mm) == ("cuboid", press.truth.size_mm)
    assert scene_.depth_mm == press.truth.height_mm
    # Four standard deviations of the hand in each direction.
    assert np.hypot(*np.subtract((scene_.x_mm, scene_.y_mm), press.position_mm)) < 0.6
    bench.arrange(x_mm=0.0)
    hand.press(press)
    assert bench.scene.x_mm == 0.0
    hand.lift()
    assert bench.scene.item == "bare"


@pytest.fixture
def camera(context):
    """Return the selected camera. Its calibration is in the library."""
    calibration = scene.calibration()
    write_calibration(calibration, context.workspace.calibration_path("T-1", "first"))
    made = SceneCamera(calibration)
    context.source.choose(SourceInfo("camera", made.name, "", lambda: made))
    return made


@pytest.fixture
def kept():
    """Return the records of complete runs."""
    return []


@pytest.fixture
def view(context, camera, kept, qtbot):
    made = ProtocolView(kept.append, context=context)
    made.resize(1280, 800)
    made.show()
    made.enter()
    yield made
    made.leave()
    made.may_close()
    made.close()
    made.deleteLater()


def choose(view: ProtocolView, qtbot: QtBot, *, repeats: int, regions: int = 0) -> None:
    """Select only a cylinder of 5 mm and 0.5 mm height: a click, and a choice of the shape."""
    objects = view.setup.objects
    (item,) = objects.findItems("5 mm, height 0.5 mm", Qt.MatchFlag.MatchExactly)
    qtbot.mouseClick(
        objects.viewport(), Qt.MouseButton.LeftButton, pos=objects.visualItemRect(item).center()
    )
    view.setup.presses.change(shape="cylinder", repeats=repeats, regions=regions)


def begin(view: ProtocolView, qtbot: QtBot) -> RunPanel:
    """Start a run. Return its panel, which asks for the bare membrane."""
    view.setup.begin.click()
    qtbot.waitUntil(lambda: view.run is not None, timeout=WAIT_MS)
    panel = view.run.pressing.panel
    qtbot.waitUntil(panel.bare.isEnabled, timeout=WAIT_MS)
    return panel


def take_bare(panel: RunPanel, qtbot: QtBot) -> None:
    qtbot.waitUntil(panel.bare.isEnabled, timeout=WAIT_MS)
    panel.bare.click()
    qtbot.waitUntil(panel.capture.isEnabled, timeout=WAIT_MS)


def wait_until_asked(view: ProtocolView, qtbot: QtBot) -> None:
    """Wait until the program has captured the bare membrane and requests a press."""
    live = view.run.pressing.panel.live
    qtbot.waitUntil(lambda: live.text().startswith("Press the object in"), timeout=WAIT_MS)


def press_next(view: ProtocolView, camera: SceneCamera, qtbot: QtBot) -> None:
    """Press at the mark, wait until it is captured, and lift."""
    wait_until_asked(view, qtbot)
    run = view.run.work.run
    before, wanted = run.progress.done, run.next()
    camera.press(wanted.position_mm)
    qtbot.waitUntil(lambda: run.progress.done == before + 1, timeout=WAIT_MS)
    camera.press(None)


def test_presses_are_captured_automatically_continued_and_reported(
    view, camera, kept, context, qtbot, tmp_path
):
    choose(view, qtbot, repeats=1, regions=1)
    take_bare(begin(view, qtbot), qtbot)
    assert view.run.pressing.panel.title.text() == "Cylinder 5 mm, height 0.5 mm"
    press_next(view, camera, qtbot)
    folder = view.run.work.run.folder
    assert view.run.pressing.panel.where.text().startswith("Random region 1")

    view.run.pressing.panel.leave.click()
    assert view.run is None
    again = view.findChild(QPushButton, "protocol.run.0")
    assert "1 of 2 presses" in again.text()
    with RunLock(folder):  # like another program
        again.click()
        qtbot.waitUntil(lambda: "written by" in view.setup.problem.text(), timeout=WAIT_MS)
    view.findChild(QPushButton, "protocol.run.0").click()
    qtbot.waitUntil(lambda: view.run is not None, timeout=WAIT_MS)
    assert view.run.work.run.folder == folder
    take_bare(view.run.pressing.panel, qtbot)
    context.settings.limits = Limits(size_percent=1e-6, height_percent=1e-6)
    context.settings.save()
    settings_file().parent.mkdir()
    shutil.copy(context.settings.path, settings_file())  # as the command reads them
    press_next(view, camera, qtbot)

    # The last press shows the result automatically.
    qtbot.waitUntil(lambda: "all 2 presses" in view.run.result.verdict.text(), timeout=WAIT_MS)
    assert [(r.shape, r.picture, r.serial) for r in kept] == [
        ("evaluation", str(folder), view.run.work.run.content.serial)
    ]
    context.settings.limits = Limits()
    view.run.result.save(folder / "report")
    qtbot.waitUntil((folder / "report" / "gauge.csv").is_file, timeout=WAIT_MS)
    names = {path.suffix for path in (folder / "report").iterdir()}
    assert {".csv", ".json", ".pdf"} <= names

    # The report uses the tolerances that were shown, not the present ones.
    report = report_data(folder / "report" / "evaluation.pdf")["data"]["evaluation"]
    assert report["tolerance_percent"] == {"planar": 1e-6, "depth": 1e-6}
    # Three images of the bare membrane at the beginning, and three when it went on.
    assert len(list((folder / "presses" / "flat").glob("*.png"))) == 2 * LEAST_FLAT
    known = {row["key"]: row["needed"] for row in report["characteristics"]}
    assert known["amplification_z_percent"] and "flat" not in known["measurement_noise_um"]

    calibration = context.workspace.entries()[0].path
    assert main(["evaluate", str(calibration), str(folder), "-o", str(tmp_path / "out")]) == 0
    for name in ("evaluation.csv", "evaluation.json", "gauge.csv"):
        on_screen = (folder / "report" / name).read_bytes()
        assert (tmp_path / "out" / name).read_bytes() == on_screen


def test_what_cannot_be_used_is_refused_with_its_reason_and_requested_again(
    view, camera, qtbot, caplog
):
    assert "Objects: 18. Presses: 540" in view.setup.summary.text()
    choose(view, qtbot, repeats=0)
    assert not view.setup.begin.isEnabled()
    choose(view, qtbot, repeats=2)
    assert "Objects: 1. Presses: 2" in view.setup.summary.text()

    # A membrane with an object on it, and a camera of another size.
    def frames_pass() -> None:
        made = camera.made
        qtbot.waitUntil(lambda: camera.made > made + 2, timeout=WAIT_MS)

    camera.press((0.0, 0.0))
    panel = begin(view, qtbot)
    panel.bare.click()
    pressed = "Something presses on the membrane"
    qtbot.waitUntil(lambda: pressed in caplog.text, timeout=WAIT_MS)
    assert not panel.capture.isEnabled()
    camera.press(None)
    camera.cropped = True
    frames_pass()
    panel.bare.click()
    sizes = "160x240", "320x240"
    qtbot.waitUntil(lambda: all(s in panel.live.text() for s in sizes), timeout=WAIT_MS)
    assert not panel.capture.isEnabled()
    camera.cropped = False
    frames_pass()
    take_bare(panel, qtbot)
    assert panel.bare.isVisible()  # if that was wrong after all, it can be done again

    # An unsteady press.
    run = view.run.work.run
    wait_until_asked(view, qtbot)
    camera.shaking = True
    camera.press(run.next().position_mm)
    qtbot.waitUntil(lambda: panel.live.text() == "Hold it still.", timeout=WAIT_MS)
    panel.capture.click()
    qtbot.waitUntil(lambda: run.progress.refused == 1, timeout=WAIT_MS)
    assert run.progress.done == 0
    with (run.folder / "refused.csv").open() as file:
        assert "It moved" in next(csv.reader(file))[2]
    assert "1 refused" in panel.counts.text()
    camera.shaking = False
    qtbot.waitUntil(lambda: run.progress.done == 1, timeout=WAIT_MS)
    # It must be lifted in between: one press does not count twice.
    qtbot.waitUntil(lambda: panel.live.text().startswith("Lift"), timeout=WAIT_MS)
    panel.take_back.click()
    assert run.progress.done == 0
    assert len(list((run.folder / "discarded").iterdir())) == 1
