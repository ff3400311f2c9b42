"""The controls of the virtual sensor, next to the views of a page."""

from __future__ import annotations

from functools import partial

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import QCheckBox, QComboBox, QGroupBox, QWidget

from app.program.context import SourceSelection
from app.sources.virtual_bench import (
    FAULTS,
    FLAT,
    PRESSED,
    BenchConditions,
    BenchScene,
    VirtualBench,
)
from app.widgets.actions import tool_button
from app.widgets.forms import Form
from app.widgets.inputs import NumberField, Slider
from app.widgets.layout import hbox, vbox
from app.widgets.text_roles import named_label
from app.widgets.widget_names import set_names

_SLIDER_STEPS_PER_MM = 100


class BenchPanel(QWidget):
    """Shows and changes the objects and faults of the virtual sensor.

    Parameters
    ----------
    bench : VirtualBench
        The bench of the virtual sensor.
    """

    _bench_changed = Signal()

    def __init__(self, *, bench: VirtualBench) -> None:
        super().__init__()
        self._bench = bench
        set_names(self, "bench", "Virtual bench")
        self._scene, self._conditions = (
            Form(BenchScene(), "bench"),
            Form(BenchConditions(), "bench"),
        )
        self._scene.changed.connect(self._change_scene)
        self._conditions.changed.connect(lambda key, value: bench.set_conditions(**{key: value}))
        items = self._scene.inputs["item"]
        assert isinstance(items, QComboBox)
        # The list shows long names in full; the box may be narrower.
        items.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        items.setMinimumContentsLength(10)
        self._pose = set_names(NumberField(), "bench.pose", "Pose of the checkerboard")
        self._pose.valueChanged.connect(lambda number: self._show_pose(int(number) - 1))
        self._pose_row = QWidget()
        hbox(
            self._pose,
            self._step_button("previous_pose", "Back", "Previous pose of the checkerboard"),
            self._step_button("next_pose", "Next", "Next pose of the checkerboard"),
            of=self._pose_row,
            margins=0,
        )
        self._scene.rows.insertRow(1, "Pose", self._pose_row)
        self._depth = set_names(
            Slider(Qt.Orientation.Horizontal),
            "bench.depth_slider",
            "Depth",
            "Depth of the object's foremost point in the membrane",
        )
        self._depth.valueChanged.connect(
            lambda steps: bench.set_scene(depth_mm=steps / _SLIDER_STEPS_PER_MM)
        )
        self._scene.rows.addRow(self._depth)
        hint = "Drag the object in the image to move it. The middle mouse button moves the image."
        self._hint = named_label("bench.hint", "Hint", text=hint)
        image, faults = QGroupBox("Image"), QGroupBox("Simulate a fault")
        vbox(self._conditions, of=image)
        self._faults: dict[str, QCheckBox] = {}
        for fault, (name, tip) in FAULTS.items():
            self._faults[fault] = set_names(QCheckBox(name), f"bench.fault.{fault}", name, tip)
            self._faults[fault].toggled.connect(partial(bench.switch, fault))
        vbox(*self._faults.values(), of=faults)
        vbox(self._scene, self._hint, image, faults, None, of=self, margins=0)
        self.setMinimumWidth(236)
        self._bench_changed.connect(self.show_bench)
        # Methods, not lambdas, so that nothing keeps the panel alive once Qt has deleted it.
        forget = bench.watch(self._bench_changed.emit)
        self.destroyed.connect(lambda: forget())
        self.show_bench()

    def choose_item(self) -> None:
        """Show the list of objects."""
        items = self._scene.inputs["item"]
        assert isinstance(items, QComboBox)
        items.setFocus()
        items.showPopup()

    def _step_button(self, name: str, text: str, accessible: str) -> QWidget:
        step = -1 if name == "previous_pose" else 1
        return tool_button(
            f"bench.{name}", text, lambda: self._step_pose(step), accessible=accessible
        )

    def _change_scene(self, key: str, value: str | float) -> None:
        if isinstance(value, str):
            self._bench.place_object(value)
        else:
            self._bench.set_scene(**{key: value})

    def _show_pose(self, number: int) -> None:
        self._bench.show("checkerboard", number)

    def _step_pose(self, step: int) -> None:
        count = self._bench.steps("checkerboard")
        self._show_pose((self._bench.scene.pose + step) % count)

    def show_bench(self) -> None:
        """Show the objects and faults of now."""
        bench, scene, conditions = self._bench, self._bench.scene, self._bench.conditions
        deepest, reach = bench.depth_range_mm(scene), bench.reach_mm(scene)
        self._scene.limit("size_mm", *bench.size_range_mm())
        self._scene.limit("depth_mm", *deepest)
        for key in ("x_mm", "y_mm"):
            self._scene.limit(key, -reach, reach)
        self._scene.show_value(scene)
        self._conditions.show_value(conditions)
        with QSignalBlocker(self._pose), QSignalBlocker(self._depth):
            if scene.item == "checkerboard":
                count = bench.steps("checkerboard")
                self._pose.setSuffix(f" of {count}")
                self._pose.setRange(1, count)
                self._pose.setValue(scene.pose + 1)
            self._depth.setRange(*(round(end * _SLIDER_STEPS_PER_MM) for end in deepest))
            self._depth.setValue(round(scene.depth_mm * _SLIDER_STEPS_PER_MM))
        for fault, check in self._faults.items():
            with QSignalBlocker(check):
                check.setChecked(fault in conditions.faults)
        sizes = {"cuboid": "Side", "nut": "Across flats"}
        self._scene.rename_row("size_mm", sizes.get(scene.item, "Diameter"))
        self._scene.rows.setRowVisible(self._pose_row, scene.item == "checkerboard")
        self._scene.rows.setRowVisible(self._depth, scene.item in PRESSED)
        self._hint.setVisible(scene.item not in FLAT)


class BenchArea(QWidget):
    """Holds the bench panel. It is empty until the virtual sensor is selected.

    Parameters
    ----------
    source : SourceSelection
        The selected source, with its bench.
    """

    def __init__(self, source: SourceSelection) -> None:
        super().__init__()
        self._source = source
        self._column = vbox(of=self, margins=0)
        self._panel: BenchPanel | None = None

    def follow(self) -> bool:
        """Show the bench of the selected source. Return whether there is one."""
        bench = self._source.virtual
        if bench is None:
            return False
        if self._panel is None:
            self._panel = BenchPanel(bench=bench)
            self._column.addWidget(self._panel)
        return True

    def hold(self, on: bool) -> None:
        """Stay at the values of now while the image is frozen, or continue."""
        self.setEnabled(not on)
        if self._panel is not None:
            self._panel.blockSignals(on)
            self._panel.show_bench()

    def choose_item(self) -> None:
        """Show the list of objects."""
        if self._panel is not None:
            self._panel.choose_item()
