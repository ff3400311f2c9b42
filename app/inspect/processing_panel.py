"""Panel for the processing of a frozen height map, and the line that says what was done."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QFormLayout,
    QHBoxLayout,
    QPushButton,
    QSizePolicy,
    QWidget,
)

from app.view2d.processing import Processing
from app.view2d.quantities import Reference
from app.widgets.inputs import ComboBox, DoubleSpinBox, SpinBox
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.meaning import show_meaning
from app.widgets.naming import named
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.map_processing import LARGEST_MEDIAN
from gelpolight_core.translation import tr

Points = tuple[tuple[float, float], ...]


class ProcessingPanel(QWidget):
    """Lets the user choose mask, levelling, filter and a reference to subtract.

    Signals
    -------
    changed()
        A choice changed.
    hold_wanted()
        The height map of now is wanted as the reference.
    """

    changed = Signal()
    hold_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        named(self, "inspect.processing", tr("Processing"))
        self._reference: Reference | None = None
        form = QFormLayout(self)
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        self._make_mask(form)
        self._make_level(form)
        self._make_filter(form)
        self._make_reference(form)
        self._state = named(
            PlainLabel(tr("Applies to a frozen image. Press Space to freeze it.")),
            "inspect.processing.state",
            tr("State of the processing"),
        )
        self._state.setWordWrap(True)
        show_meaning(self._state, "muted")
        self._reset = named(
            QPushButton(tr("Reset")), "inspect.processing.reset", tr("Reset the processing"),
            tr("Show the height map as reconstructed"),
        )  # fmt: skip
        self._reset.clicked.connect(self.reset)
        form.addRow(self._state)
        form.addRow(self._reset)
        self.show_reference(None)

    def _make_mask(self, form: QFormLayout) -> None:
        self._mask = named(
            ComboBox(), "inspect.processing.mask", tr("Mask"),
            tr("Keep a part of the points only. The others have no depth, and are left out of "
               "levelling, filter, histogram and export"),
        )  # fmt: skip
        for key, text in (
            ("none", tr("none")),
            ("inside", tr("keep the rectangle")),
            ("outside", tr("leave out the rectangle")),
            ("deeper", tr("keep deeper points")),
            ("sure", tr("leave out flagged points")),
        ):
            self._mask.addItem(text, key)
        self._deeper = named(
            DoubleSpinBox(), "inspect.processing.deeper", tr("Smallest depth of the mask")
        )
        self._deeper.setRange(-5.0, 5.0)
        self._deeper.setDecimals(3)
        self._deeper.setSingleStep(0.05)
        self._deeper.setSuffix(tr(" mm"))
        self._deeper.setPrefix(tr("deeper than "))
        self._deeper.setValue(Processing().deeper_mm)
        self._deeper.setKeyboardTracking(False)
        self._mask.currentIndexChanged.connect(self._on_changed)
        self._deeper.valueChanged.connect(self._on_changed)
        form.addRow(tr("Mask"), self._mask)
        form.addRow("", self._deeper)

    def _make_level(self, form: QFormLayout) -> None:
        self._level = named(
            ComboBox(), "inspect.processing.level", tr("Levelling"),
            tr("Subtract a plane: of the untouched surface (pressed objects are left out), of the "
               "rectangle on the map, or through three points on the map"),
        )  # fmt: skip
        for key, text in (
            ("none", tr("none")),
            ("plane", tr("plane")),
            ("rectangle", tr("plane of the rectangle")),
            ("points", tr("three points")),
        ):
            self._level.addItem(text, key)
        self._level.currentIndexChanged.connect(self._on_changed)
        form.addRow(tr("Levelling"), self._level)

    def _make_filter(self, form: QFormLayout) -> None:
        self._filter = named(
            ComboBox(), "inspect.processing.filter", tr("Filter"),
            tr("Smooth the height map. The uncertainty of a smoothed map is not known"),
        )  # fmt: skip
        for key, text in (
            ("none", tr("none")),
            ("gaussian", tr("Gaussian")),
            ("median", tr("median")),
        ):
            self._filter.addItem(text, key)
        self._sigma = named(DoubleSpinBox(), "inspect.processing.sigma", tr("Sigma of the filter"))
        self._sigma.setRange(0.01, 2.0)
        self._sigma.setDecimals(2)
        self._sigma.setSingleStep(0.05)
        self._sigma.setSuffix(tr(" mm"))
        self._sigma.setPrefix(tr("sigma "))
        self._sigma.setValue(Processing().sigma_mm)
        self._nodes = named(SpinBox(), "inspect.processing.nodes", tr("Points of the filter"))
        self._nodes.setRange(3, LARGEST_MEDIAN)
        self._nodes.setSingleStep(2)
        self._nodes.setSuffix(tr(" points"))
        self._filter.currentIndexChanged.connect(self._on_changed)
        for size in (self._sigma, self._nodes):
            size.setKeyboardTracking(False)
            size.valueChanged.connect(self._on_changed)
        form.addRow(tr("Filter"), self._filter)
        form.addRow("", self._sigma)
        form.addRow("", self._nodes)
        self._form = form

    def _make_reference(self, form: QFormLayout) -> None:
        self._subtract = named(
            QCheckBox(tr("Subtract")), "inspect.processing.subtract", tr("Subtract the reference")
        )
        self._subtract.toggled.connect(self._on_changed)
        self._hold = named(
            QPushButton(tr("Hold")), "inspect.processing.hold", tr("Hold as the reference"),
            tr("Use the current height map, as reconstructed, as the reference"),
        )  # fmt: skip
        self._hold.clicked.connect(self.hold_wanted)
        row = QHBoxLayout()
        row.addWidget(self._subtract, 1)
        row.addWidget(self._hold)
        form.addRow(tr("Reference"), row)

    @property
    def level(self) -> str:
        """The levelling, one of LEVELLINGS."""
        return str(self._level.currentData())

    @property
    def mask(self) -> str:
        """The mask, one of MASKS."""
        return str(self._mask.currentData())

    @property
    def has_rectangle(self) -> bool:
        """Whether the rectangle on the map is used."""
        return self.level == "rectangle" or self.mask in ("inside", "outside")

    def processing(self, rectangle: Rectangle, points_mm: Points) -> Processing:
        """Return what is to be done, with the rectangle and the points on the map."""
        return Processing(
            reference=self._reference if self._subtract.isChecked() else None,
            mask=self.mask,
            deeper_mm=self._deeper.value(),
            level=self.level,
            rectangle=rectangle if self.has_rectangle else None,
            points_mm=points_mm if self.level == "points" else (),
            filter=str(self._filter.currentData()),
            sigma_mm=self._sigma.value(),
            # The keyboard can give an even number.
            nodes=self._nodes.value() | 1,
        )

    def show_reference(self, reference: Reference | None) -> None:
        """Offer a reference to subtract, or none."""
        self._reference = reference
        text = tr("There is no reference. Hold a height map first.")
        if reference is not None:
            text = tr("Show the difference from the reference: {name}").format(name=reference.name)
        self._subtract.setToolTip(plain_tip(text))
        self._subtract.setEnabled(reference is not None)
        if reference is None:
            self._subtract.setChecked(False)
        self._on_changed()

    def reset(self) -> None:
        """Do nothing to the height map. The reference is kept."""
        inputs = self._mask, self._level, self._filter, self._subtract
        blocked = [QSignalBlocker(widget) for widget in inputs]
        self._mask.setCurrentIndex(0)
        self._level.setCurrentIndex(0)
        self._filter.setCurrentIndex(0)
        self._subtract.setChecked(False)
        for blocker in blocked:
            blocker.unblock()
        self._on_changed()

    def show_still(self, still: bool) -> None:
        """Show why the choices have no effect on a live image."""
        self._state.setVisible(not still)

    def _on_changed(self) -> None:
        self._follow()
        self.changed.emit()

    def _follow(self) -> None:
        """Show only the inputs that count."""
        chosen = self._filter.currentData()
        self._form.setRowVisible(self._deeper, self.mask == "deeper")
        self._form.setRowVisible(self._sigma, chosen == "gaussian")
        self._form.setRowVisible(self._nodes, chosen == "median")
        any_step = {self.mask, self.level, chosen} != {"none"}
        self._reset.setEnabled(any_step or self._subtract.isChecked())


class ProcessedLine(QWidget):
    """Says above the views what was done to the height map. Hidden if nothing was done.

    Signals
    -------
    reset_wanted()
        The height map is wanted as reconstructed.
    """

    reset_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        named(self, "inspect.processed", tr("Processed height map"))
        self._text = named(PlainLabel(), "inspect.processed.steps", tr("Steps of the processing"))
        self._text.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        reset = named(
            QPushButton(tr("Reset")), "inspect.processed.reset", tr("Reset the processing")
        )
        reset.clicked.connect(self.reset_wanted)
        row = QHBoxLayout(self)
        row.setContentsMargins(10, 2, 10, 2)
        row.addWidget(self._text, 1)
        row.addWidget(reset)
        self.hide()

    def show_steps(self, steps: tuple[str, ...], refused: str) -> None:
        """Show what was done, or why it could not be done."""
        text = tr("Processed height map: {steps}").format(steps=" ".join(steps))
        self._text.setText(refused or text)
        self._text.setToolTip(plain_tip(self._text.text()))
        show_meaning(self._text, "fail" if refused else "warn")
        self.setVisible(bool(steps or refused))
