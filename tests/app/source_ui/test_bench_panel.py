"""The bench panel lets a technician place objects on the virtual sensor."""

import threading
from typing import TypeVar

import pytest
from PySide6.QtWidgets import QCheckBox, QComboBox, QDoubleSpinBox, QSlider, QWidget
from shiboken6 import isValid

from app.source_ui.bench_panel import BenchPanel
from app.sources.virtual_bench import FAULTS, ITEMS, VirtualBench
from gelpolight_core.simulation.sensor_design import SensorDesign

W = TypeVar("W", bound=QWidget)


@pytest.fixture
def bench():
    return VirtualBench(SensorDesign().scaled(0.25))


@pytest.fixture
def panel(qtbot, bench):
    panel = BenchPanel(bench=bench)
    qtbot.addWidget(panel)
    panel.show()
    yield panel
    panel.close()


def find(panel: BenchPanel, kind: type[W], name: str) -> W:
    """Return a control by its name."""
    widget = panel.findChild(kind, f"bench.{name}")
    return widget


def choose(panel: BenchPanel, item: str) -> None:
    box = find(panel, QComboBox, "item")
    box.setCurrentIndex(box.findData(item))


@pytest.mark.function("Operate the virtual sensor: object, pose, depth, exposure, faults")
def test_choosing_an_object_puts_it_on_the_sensor(panel, bench):
    for item, name in ITEMS.items():
        choose(panel, item)
        assert bench.scene.item == item
        assert find(panel, QComboBox, "item").currentText() == name


def test_only_relevant_controls_are_shown(panel):
    fields = {
        name: panel.findChild(QWidget, f"bench.{name}")
        for name in ("pose", "size_mm", "depth_mm", "x_mm", "yaw_deg")
    }
    expected = {
        "mirror": set(),
        "checkerboard": {"pose", "x_mm", "yaw_deg"},
        "ball": {"size_mm", "depth_mm", "x_mm"},
        "cuboid": {"size_mm", "depth_mm", "x_mm", "yaw_deg"},
    }
    for item, names in expected.items():
        choose(panel, item)
        assert {name for name, field in fields.items() if field.isVisible()} == names


def test_numbers_and_the_depth_slider_move_the_object(panel, bench):
    choose(panel, "cuboid")
    for name, value in {"x_mm": 1.5, "y_mm": -2.0, "yaw_deg": 30.0, "size_mm": 4.0}.items():
        find(panel, QDoubleSpinBox, name).setValue(value)
        assert getattr(bench.scene, name) == value
    find(panel, QSlider, "depth_slider").setValue(150)
    assert bench.scene.depth_mm == 1.5
    assert find(panel, QDoubleSpinBox, "depth_mm").value() == 1.5


def test_a_ball_cannot_be_pressed_deeper_than_its_radius(panel, bench):
    choose(panel, "ball")
    find(panel, QDoubleSpinBox, "size_mm").setValue(1.0)
    depth = find(panel, QDoubleSpinBox, "depth_mm")
    assert (depth.maximum(), depth.value()) == (0.5, 0.5)
    assert find(panel, QSlider, "depth_slider").maximum() == 50


@pytest.mark.function("Drag an object on the virtual sensor's image")
def test_dragging_on_the_image_moves_the_object_and_its_numbers(panel, bench):
    choose(panel, "ball")
    bench.drag_to(200.0, 100.0)
    scene = bench.scene
    assert scene.x_mm > 0.0 > scene.y_mm
    assert find(panel, QDoubleSpinBox, "x_mm").value() == pytest.approx(scene.x_mm, abs=0.005)
    # The control shows a rounded position; the object's position is exact.
    assert scene.x_mm != round(scene.x_mm, 2)


def test_exposure_noise_and_faults_reach_the_bench(panel, bench):
    find(panel, QDoubleSpinBox, "exposure_ms").setValue(4.0)
    find(panel, QDoubleSpinBox, "gain_db").setValue(6.0)
    find(panel, QDoubleSpinBox, "noise").setValue(0.0)
    conditions = bench.conditions
    assert (conditions.exposure_ms, conditions.gain_db, conditions.noise) == (4.0, 6.0, 0.0)
    for fault in FAULTS:
        find(panel, QCheckBox, f"fault.{fault}").click()
    assert bench.conditions.faults == set(FAULTS)
    find(panel, QCheckBox, "fault.room_light").click()
    assert "room_light" not in bench.conditions.faults


def test_changes_from_another_thread_are_shown(qtbot, panel, bench):
    other = threading.Thread(target=lambda: bench.set_conditions(exposure_ms=3.0))
    other.start()
    other.join()
    box = find(panel, QDoubleSpinBox, "exposure_ms")
    qtbot.waitUntil(lambda: box.value() == 3.0)


def test_a_deleted_panel_is_not_notified(qtbot, bench):
    panel = BenchPanel(bench=bench)
    panel.deleteLater()
    qtbot.waitUntil(lambda: not isValid(panel))
    bench.place_object("ball")  # would raise if the deleted panel were notified
