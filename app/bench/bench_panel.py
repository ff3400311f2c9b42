"""A narrow panel to choose the object on the virtual sensor and the camera settings."""

from __future__ import annotations

from functools import partial

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QFormLayout,
    QGroupBox,
    QSizePolicy,
    QSlider,
    QSpinBox,
    QWidget,
)

from app.sources.bench import CONDITION_RANGES, FAULTS, FLAT, PRESSED, Bench, Scene
from app.widgets.buttons import tool_button
from app.widgets.inputs import ComboBox, DoubleSpinBox, Slider, SpinBox
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.naming import named
from gelpolight_core.translation import tr

_SLIDER_STEPS_PER_MM = 100


def item_names() -> dict[str, str]:
    """Return the label of each object that can be on the sensor."""
    return {
        "checkerboard": tr("Checkerboard, hand-held"),
        "board_on_top": tr("Checkerboard on the top surface"),
        "mirror": tr("Mirror"),
        "whiteboard": tr("Whiteboard"),
        "bare": tr("Bare membrane"),
        "ball": tr("Ball"),
        "cylinder": tr("Cylinder"),
        "cuboid": tr("Cuboid"),
        "coin": tr("Coin"),
        "nut": tr("Nut"),
    }


def _size_name(item: str) -> str:
    if item == "cuboid":
        return tr("Side")
    return tr("Across flats") if item == "nut" else tr("Diameter")


def _fault_names() -> dict[str, tuple[str, str]]:
    return {
        "camera_stops": (
            tr("Camera failure"),
            tr("No more images arrive, as with an unplugged cable"),
        ),
        "room_light": (tr("Room light on"), tr("Light from outside falls into the sensor")),
        "membrane_on": (tr("Membrane mounted"), tr("The membrane hides the mirror")),
        "too_bright": (tr("Overexposed"), tr("Three times too much light")),
        "led_off": (tr("Blue LED off"), tr("The blue LED gives no light")),
        "defocused": (tr("Out of focus"), tr("The lens is turned away from its focus")),
        "dust": (tr("Dust"), tr("Specks of dust between camera and membrane")),
    }


class BenchPanel(QWidget):
    """Shows and changes a bench; follows changes made elsewhere.

    Parameters
    ----------
    bench : Bench
        The bench of the virtual sensor.
    """

    _bench_changed = Signal()

    def __init__(self, *, bench: Bench) -> None:
        super().__init__()
        self._bench = bench
        named(self, "bench", tr("Virtual bench"))
        self._form = QFormLayout()
        self._form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        self._form.setLabelAlignment(Qt.AlignmentFlag.AlignLeft)
        self._fill_scene()
        heading = PlainLabel(tr("On the sensor"))
        heading.setBuddy(self._item)
        groups = self._image_group(), self._fault_group()
        vbox(heading, self._item, self._form, self._hint, *groups, None, of=self, margins=0)
        self.setMinimumWidth(236)
        self._bench_changed.connect(self._show_bench)
        # Methods, not lambdas, so that nothing keeps the panel alive once Qt has deleted it.
        forget = bench.watch(self._bench_changed.emit)
        self.destroyed.connect(lambda: forget())
        self._show_bench()

    def _fill_scene(self) -> None:
        self._item = named(ComboBox(), "bench.item", tr("Object on the sensor"))
        for item, name in item_names().items():
            self._item.addItem(name, item)
        # The list shows long names in full; the box may be narrower.
        self._item.setSizeAdjustPolicy(
            QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
        )
        self._item.setMinimumContentsLength(10)
        self._item.currentIndexChanged.connect(lambda _: self._bench.lay(self._item.currentData()))
        self._pose_row = self._make_pose_row()
        self._form.addRow(tr("Pose"), self._pose_row)
        self._size = self._number("size_mm", tr("Size of the object"), tr("mm"), 0.1)
        self._size_label = PlainLabel()
        self._form.addRow(self._size_label, self._size)
        self._depth = self._number("depth_mm", tr("Depth"), tr("mm"), 0.01)
        self._depth_slider = named(
            Slider(Qt.Orientation.Horizontal),
            "bench.depth_slider",
            tr("Depth"),
            tr("Depth of the object's foremost point in the membrane"),
        )
        self._depth_slider.valueChanged.connect(
            lambda steps: self._bench.arrange(depth_mm=steps / _SLIDER_STEPS_PER_MM)
        )
        self._depth_row = _row(self._depth_slider, self._depth)
        self._depth.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Fixed)
        self._form.addRow(tr("Depth"), self._depth_row)
        self._x = self._number("x_mm", tr("Position to the right"), tr("mm"), 0.1)
        self._y = self._number("y_mm", tr("Position downwards"), tr("mm"), 0.1)
        self._form.addRow(tr("x, right"), self._x)
        self._form.addRow(tr("y, down"), self._y)
        self._yaw = self._number("yaw_deg", tr("Rotation"), "°", 1.0)
        self._yaw.setRange(-180.0, 180.0)
        self._yaw.setWrapping(True)
        self._form.addRow(tr("Rotation"), self._yaw)
        self._hint = named(
            PlainLabel(
                tr(
                    "Drag the object in the image to move it. The middle mouse button moves the "
                    "image."
                ),
                wrap=True,
            ),
            "bench.hint",
            tr("Hint"),
        )

    def _make_pose_row(self) -> QWidget:
        self._pose = named(SpinBox(), "bench.pose", tr("Pose of the checkerboard"))
        self._pose.valueChanged.connect(lambda number: self._show_pose(number - 1))
        back = tool_button(
            "bench.previous_pose",
            tr("Back"),
            lambda: self._step_pose(-1),
            accessible=tr("Previous pose of the checkerboard"),
        )
        on = tool_button(
            "bench.next_pose",
            tr("Next"),
            lambda: self._step_pose(1),
            accessible=tr("Next pose of the checkerboard"),
        )
        return _row(self._pose, back, on)

    def _number(self, key: str, accessible: str, unit: str, step: float) -> QDoubleSpinBox:
        box = named(DoubleSpinBox(), f"bench.{key}", accessible)
        box.setDecimals(2 if step < 1.0 else 1)
        box.setSingleStep(step)
        box.setSuffix(f" {unit}")
        # Ignore a number while it is being typed.
        box.setKeyboardTracking(False)
        if key in CONDITION_RANGES:
            box.setRange(*CONDITION_RANGES[key])
            box.valueChanged.connect(lambda value: self._bench.adjust(**{key: value}))
        else:
            box.valueChanged.connect(lambda value: self._bench.arrange(**{key: value}))
        return box

    def _image_group(self) -> QWidget:
        group = QGroupBox(tr("Image"))
        form = QFormLayout(group)
        self._conditions = {}
        for key, text, unit, step in (
            ("exposure_ms", tr("Exposure"), tr("ms"), 0.5),
            ("gain_db", tr("Gain"), tr("dB"), 1.0),
            ("noise", tr("Noise"), tr("times"), 0.1),
        ):
            self._conditions[key] = self._number(key, text, unit, step)
            form.addRow(text, self._conditions[key])
        self._conditions["noise"].setToolTip(tr("0 is no noise, 1 is the noise of the design"))
        return group

    def _fault_group(self) -> QWidget:
        group = QGroupBox(tr("Simulate a fault"))
        self._faults: dict[str, QCheckBox] = {}
        for fault in FAULTS:
            name, tip = _fault_names()[fault]
            box = named(QCheckBox(name), f"bench.fault.{fault}", name, tip)
            box.toggled.connect(partial(self._bench.switch, fault))
            self._faults[fault] = box
        vbox(*self._faults.values(), of=group)
        return group

    def _show_pose(self, number: int) -> None:
        self._bench.show("checkerboard", number)

    def _step_pose(self, step: int) -> None:
        count = self._bench.steps("checkerboard")
        self._show_pose((self._bench.scene.pose + step) % count)

    def _show_bench(self) -> None:
        scene, conditions = self._bench.scene, self._bench.conditions
        with QSignalBlocker(self._item):
            self._item.setCurrentIndex(self._item.findData(scene.item))
        self._show_rows(scene)
        if scene.item == "checkerboard":
            count = self._bench.steps("checkerboard")
            self._pose.setSuffix(tr(" of {count}").format(count=count))
            _set_range(self._pose, 1, count, scene.pose + 1)
        reach = self._bench.reach_mm(scene)
        _set_range(self._x, -reach, reach, scene.x_mm)
        _set_range(self._y, -reach, reach, scene.y_mm)
        _set_range(self._yaw, -180.0, 180.0, scene.yaw_deg)
        if scene.item in PRESSED:
            self._size_label.setText(_size_name(scene.item))
            _set_range(self._size, *self._bench.size_range_mm(), scene.size_mm)
            low, high = self._bench.depth_range_mm(scene)
            _set_range(self._depth, low, high, scene.depth_mm)
            steps = (round(value * _SLIDER_STEPS_PER_MM) for value in (low, high, scene.depth_mm))
            _set_range(self._depth_slider, *steps)
        for key, box in self._conditions.items():
            _set_range(box, *CONDITION_RANGES[key], getattr(conditions, key))
        for fault, check in self._faults.items():
            with QSignalBlocker(check):
                check.setChecked(fault in conditions.faults)

    def _show_rows(self, scene: Scene) -> None:
        movable = scene.item not in FLAT
        self._form.setRowVisible(self._pose_row, scene.item == "checkerboard")
        for field in (self._size, self._depth_row):
            self._form.setRowVisible(field, scene.item in PRESSED)
        for field in (self._x, self._y):
            self._form.setRowVisible(field, movable)
        # The rotation of a round object is not visible.
        self._form.setRowVisible(self._yaw, movable and scene.item not in ("ball", "cylinder"))
        self._hint.setVisible(movable)


def _row(*widgets: QWidget) -> QWidget:
    row = QWidget()
    hbox(*widgets, of=row, margins=0)
    return row


def _set_range(
    box: QSpinBox | QDoubleSpinBox | QSlider, low: float, high: float, value: float
) -> None:
    """Show a value in its range without emitting a signal."""
    with QSignalBlocker(box):
        box.setRange(low, high)  # type: ignore[arg-type]
        box.setValue(value)  # type: ignore[arg-type]
