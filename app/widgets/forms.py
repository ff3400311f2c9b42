"""A form from a frozen dataclass of :mod:`gelpolight_core.base.form_fields`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import Field, fields, replace
from pathlib import Path
from typing import Any, Generic, TypeVar

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QDialogButtonBox,
    QFileDialog,
    QFormLayout,
    QLabel,
    QLineEdit,
    QWidget,
)

from gelpolight_core.base.form_fields import When
from gelpolight_core.base.safe_reading import NAME_LIMIT

from .dialog import Dialog
from .icons import icon
from .inputs import ComboBox, NumberField, Slider
from .label import PlainLabel
from .layout import hbox, vbox
from .widget_names import set_names

V = TypeVar("V")


class Form(QWidget, Generic[V]):
    """Shows a value and lets the user change it. Fields without a label are not shown.

    Parameters
    ----------
    value : frozen dataclass
        The first value.
    name : str
        Start of the object names of the inputs. The name of the field follows.
    only : tuple of str, optional
        The fields that are shown, if not all.
    narrow : bool, optional
        Whether every field gets its own row.

    Attributes
    ----------
    value : frozen dataclass
        The value with all changes of the user.
    inputs : dict of str to QWidget
        The input of each field.
    rows : QFormLayout
        The layout.

    Signals
    -------
    changed(str, object)
        The user has entered a value. The name of its field, and the value.
    """

    changed = Signal(str, object)

    def __init__(
        self,
        value: V,
        name: str,
        *,
        only: tuple[str, ...] = (),
        narrow: bool = False,
    ) -> None:
        super().__init__()
        self._name = name
        self.inputs: dict[str, QWidget] = {}
        self._show: dict[str, Callable[[Any], object]] = {}
        self._when: dict[str, When] = {}
        self.rows = QFormLayout(self)
        self.rows.setContentsMargins(0, 0, 0, 0)
        self.rows.setRowWrapPolicy(QFormLayout.RowWrapPolicy.WrapLongRows)
        self.rows.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        for f in fields(value):  # type: ignore[arg-type]
            if "label" in f.metadata and (not only or f.name in only):
                input_widget, meta = self._input(f), f.metadata
                words = (meta["label"] or meta["text"]).replace("&", "")
                set_names(input_widget, f"{name}.{f.name}", words, meta["tip"], meta.get("key", ""))
                if meta.get("beside") and not narrow:
                    self._put_beside(list(self.inputs)[-1], meta["beside"], input_widget)
                else:
                    self.rows.addRow(meta["label"], input_widget)
                self.inputs[f.name] = input_widget
                if meta.get("when") is not None:
                    self._when[f.name] = meta["when"]
        self.show_value(value)

    def show_value(self, value: V) -> None:
        """Show another value without a signal."""
        self.value = value
        for name, show in self._show.items():
            with QSignalBlocker(self.inputs[name]):
                show(getattr(value, name))
        self._follow()

    def change(self, **values: Any) -> None:
        """Show other values of some fields, as if the user had entered them."""
        self.show_value(replace(self.value, **values))  # type: ignore[type-var]
        for name, value in values.items():
            self.changed.emit(name, value)

    def limit(self, name: str, low: float, high: float) -> None:
        """Change the range of a number without a signal."""
        field = self.inputs[name]
        assert isinstance(field, NumberField)
        with QSignalBlocker(field):
            field.setRange(low, high)

    def show_row(self, name: str, on: bool) -> None:
        """Show or hide the row of a field."""
        self.rows.setRowVisible(self._field(name), on)

    def rename_row(self, name: str, text: str) -> None:
        """Change the label of a field."""
        label = self.rows.labelForField(self._field(name))
        assert isinstance(label, QLabel)
        label.setText(text)

    def _field(self, name: str) -> QWidget:
        """Return an input, or the row in which it has another one beside it."""
        input_widget = self.inputs[name]
        holder = input_widget.parentWidget()
        return input_widget if holder in (self, None) else holder

    def _put_beside(self, name: str, text: str, second: QWidget) -> None:
        input_widget, row = self.inputs[name], QWidget()
        self.rows.replaceWidget(input_widget, row)
        hbox((input_widget, 1), PlainLabel(text), (second, 1), of=row, margins=0)

    def _follow(self) -> None:
        for name, is_visible in self._when.items():
            self.show_row(name, is_visible(self.value))

    def _input(self, f: Field[Any]) -> QWidget:
        name, meta = f.name, f.metadata

        def change(value: Any) -> None:
            if value != getattr(self.value, name):
                self.value = replace(self.value, **{name: value})  # type: ignore[type-var]
                self._follow()
                self.changed.emit(name, value)

        if "choices" in meta:
            keys, box = list(meta["choices"]), ComboBox()
            box.offer((text, key) for key, text in meta["choices"].items())
            box.currentIndexChanged.connect(lambda index: change(keys[index]))
            self._show[name] = lambda v: box.setCurrentIndex(keys.index(v) if v in keys else 0)
            return box
        if "span" in meta:
            scale = 10 ** meta["decimals"]
            low, high = meta["span"]
            if meta["slider"]:
                bar = Slider(Qt.Orientation.Horizontal)
                bar.setRange(round(scale * low), round(scale * high))
                bar.valueChanged.connect(lambda v: change(v / scale))
                self._show[name] = lambda v: bar.setValue(round(scale * v))
                return bar
            spin, is_whole = NumberField(decimals=meta["decimals"]), isinstance(f.default, int)
            spin.setRange(low, high)
            spin.setSingleStep(meta["step"])
            spin.setSuffix(meta["unit"])
            spin.setSpecialValueText(meta["none"])
            spin.valueChanged.connect(lambda v: change(int(v) if is_whole else v))
            self._show[name] = spin.setValue
            return spin
        if "several" in meta:
            group, boxes = QWidget(), {k: QCheckBox(text) for k, text in meta["several"].items()}
            vbox(*boxes.values(), of=group, margins=0)

            def show(keys: tuple[str, ...]) -> None:
                for key, check in boxes.items():
                    with QSignalBlocker(check):
                        check.setChecked(key in keys)

            for key, check in boxes.items():
                set_names(check, f"{self._name}.{name}.{key}", meta["several"][key])
                check.toggled.connect(
                    lambda: change(tuple(key for key, box in boxes.items() if box.isChecked()))
                )
            self._show[name] = show
            return group
        if isinstance(f.default, bool):
            check = QCheckBox(meta["text"])
            check.toggled.connect(change)
            self._show[name] = check.setChecked
            return check
        if "example" in meta:
            line = QLineEdit(placeholderText=meta["example"], maxLength=NAME_LIMIT)
            line.textChanged.connect(change)
            self._show[name] = line.setText
            return line
        return self._folder(name, change, relative=meta["relative"])

    def _folder(self, name: str, change: Callable[[str], None], *, relative: bool) -> QLineEdit:
        line = QLineEdit()

        def entered() -> None:
            before = Path(getattr(self.value, name))
            path = Path(line.text().strip() or before).expanduser()
            if relative:
                path = before.parent / path
            line.setText(str(path if path.is_absolute() else before))
            change(line.text())

        def browse() -> None:
            folder = QFileDialog.getExistingDirectory(self, "Choose folder", line.text())
            if folder:
                line.setText(folder)
                entered()

        line.editingFinished.connect(entered)
        button = line.addAction(icon("folder"), QLineEdit.ActionPosition.TrailingPosition)
        button.setToolTip("Choose folder")
        button.triggered.connect(browse)
        self._show[name] = line.setText
        return line


def form_dialog(
    form: Form[V], name: str, title: str, chosen: Callable[[V], object], parent: QWidget
) -> Dialog:
    """Return a dialog with a form, which calls `chosen` with the value when the user saves."""
    kinds = QDialogButtonBox.StandardButton
    dialog = Dialog(parent, name, title, kinds.Save | kinds.Cancel, once=True)
    dialog.fill(form)
    dialog.accepted.connect(lambda: chosen(form.value))
    return dialog
