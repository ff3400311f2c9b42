"""Panels for the processing and for the display of the height map."""

from __future__ import annotations

from dataclasses import fields, replace

from PySide6.QtCore import QSignalBlocker
from PySide6.QtWidgets import QCheckBox, QWidget

from app.program.display import IN_3D, DisplaySettings, DisplayStore
from app.views.map.display_processing import ProcessingSteps
from app.views.map.quantities import ReferenceMap
from app.widgets.actions import Slot, push_button
from app.widgets.forms import Form
from app.widgets.label import CutLabel, plain_tip
from app.widgets.layout import hbox, vbox
from app.widgets.text_roles import named_label, set_text_role
from app.widgets.widget_names import set_names
from gelpolight_core.measurement.area import Rectangle

MaskPoints = tuple[tuple[float, float], ...]


class ProcessingPanel(QWidget):
    """Lets the user choose levelling and a reference to subtract.

    Parameters
    ----------
    on_changed, on_hold : callable
        Called when a choice changed, and to use the present height map as the reference.

    Attributes
    ----------
    reference : ReferenceMap or None
        Reference for differences. None: there is none.
    """

    def __init__(self, *, on_changed: Slot, on_hold: Slot) -> None:
        super().__init__()
        set_names(self, "inspect.processing", "Processing")
        self._on_changed = on_changed
        self.reference: ReferenceMap | None = None
        self.form = Form(ProcessingSteps(), "inspect.processing")
        self.form.changed.connect(lambda _name, _value: on_changed())
        self._subtract = set_names(
            QCheckBox("Subtract"), "inspect.processing.subtract", "Subtract the reference"
        )
        self._subtract.toggled.connect(lambda _on: on_changed())
        hold = push_button(
            "inspect.processing.hold",
            "Hold",
            on_hold,
            accessible="Hold as the reference",
            tip="Use the current height map, as reconstructed, as the reference",
        )
        self.form.rows.addRow("Reference", hbox((self._subtract, 1), hold))
        self._state = named_label(
            "inspect.processing.state",
            "State of the processing",
            text="Applies to a frozen image. Press Space to freeze it.",
            role="muted",
        )
        vbox(self.form, self._state, of=self, margins=0)
        self._show_reference()

    def processing(self, rectangle: Rectangle, points_mm: MaskPoints) -> ProcessingSteps:
        """Return what is to be done, with the rectangle and the points on the map."""
        settings = self.form.value
        return replace(
            settings,
            reference=self.reference if self._subtract.isChecked() else None,
            rectangle=rectangle if settings.level == "rectangle" else None,
            points_mm=points_mm if settings.level == "points" else (),
        )

    def show_reference(self, reference: ReferenceMap | None) -> None:
        """Offer a reference to subtract, or none."""
        self.reference = reference
        self._show_reference()
        self._on_changed()

    def _show_reference(self) -> None:
        reference = self.reference
        text = "There is no reference. Hold a height map first."
        if reference is not None:
            text = f"Show the difference from the reference: {reference.name}"
        self._subtract.setToolTip(plain_tip(text))
        self._subtract.setEnabled(reference is not None)
        if reference is None:
            self._subtract.setChecked(False)

    def reset(self) -> None:
        """Do nothing to the height map. The reference is kept."""
        with QSignalBlocker(self._subtract):
            self._subtract.setChecked(False)
        self.form.show_value(ProcessingSteps())
        self._on_changed()

    def show_still(self, still: bool) -> None:
        """Show why the choices have no effect on a live image."""
        self._state.setVisible(not still)


class ProcessingSummary(QWidget):
    """Says above the views what was done to the height map. Hidden if nothing was done.

    Parameters
    ----------
    on_reset : callable
        Called to show the height map as reconstructed.
    """

    def __init__(self, on_reset: Slot) -> None:
        super().__init__()
        set_names(self, "inspect.processed", "Processed height map")
        self._text = set_names(CutLabel(), "inspect.processed.steps", "Steps of the processing")
        reset = push_button(
            "inspect.processed.reset", "Reset", on_reset, accessible="Reset the processing"
        )
        hbox((self._text, 1), reset, of=self, margins=(10, 2, 10, 2))
        self.hide()

    def show_steps(self, steps: tuple[str, ...], refused: str) -> None:
        """Show what was done, or why it could not be done."""
        self._text.setText(refused or f"Processed height map: {' '.join(steps)}")
        set_text_role(self._text, "fail" if refused else "warn")
        self.setVisible(bool(steps or refused))


class DisplayPanel(Form[DisplaySettings]):
    """Lets the user choose the display settings of depth.

    Parameters
    ----------
    store : DisplayStore
        Holds the settings.
    """

    def __init__(self, store: DisplayStore) -> None:
        names = tuple(f.name for f in fields(DisplaySettings) if f.name not in IN_3D)
        super().__init__(store.value, "inspect.display", only=names)
        set_names(self, "inspect.display", "Display")
        self._store, self._range_mm = store, (0.0, 1.0)
        self.changed.connect(self._on_changed)
        store.changed.connect(self._on_store)

    def show_range(self, low: float, high: float) -> None:
        """Note the range of a frame, at which it can be locked."""
        self._range_mm = low, high

    def toggle_lock(self) -> None:
        """Lock the current range, or make it automatic."""
        self._on_changed("locked", not self.value.locked)

    def lock_range(self, low: float, high: float) -> None:
        """Lock the range at these depths, mm."""
        self._range_mm = low, high
        self._on_changed("locked", True)

    def unlock_range(self) -> None:
        """Make the range automatic."""
        self._on_changed("locked", False)

    def _on_changed(self, name: str, value: object) -> None:
        if name == "locked" and value:
            low, high = self._range_mm
            self._store.change(locked=True, low_mm=low, high_mm=high)
        else:
            self._store.change(**{name: value})

    def _on_store(self) -> None:
        self.show_value(self._store.value)
