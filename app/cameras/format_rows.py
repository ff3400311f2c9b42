"""The choice of a camera's format, size and frame rate from those that it lists."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QComboBox, QFormLayout, QWidget

from app.sources.camera.driver import Format, compression_warning
from app.widgets.inputs import ComboBox
from app.widgets.label import PlainLabel
from app.widgets.meaning import show_meaning
from app.widgets.naming import named


class FormatRows(QWidget):
    """Three choices; each offers what the previous ones allow.

    Signals
    -------
    chosen(object)
        The user chose a Format.
    """

    chosen = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        named(self, "camera.formats", "Image format")
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        self._offered: tuple[Format, ...] = ()
        self._code = named(ComboBox(), "camera.format", "Format")
        self._size = named(ComboBox(), "camera.size", "Image size")
        self._rate = named(ComboBox(), "camera.rate", "Images per second")
        for label, box in (
            ("Format", self._code),
            ("Size", self._size),
            ("Rate", self._rate),
        ):
            form.addRow(label, box)
            box.activated.connect(lambda _, box=box: self._on_chosen(box))
        self.warning = named(PlainLabel(), "camera.compressed", "Drawback of the format")
        self.warning.setWordWrap(True)
        show_meaning(self.warning, "warn")
        form.addRow(self.warning)
        self.show_format(None, ())

    def show_format(self, got: Format | None, offered: tuple[Format, ...]) -> None:
        """Show the present format among those that the camera lists."""
        self._offered = offered or (() if got is None else (got,))
        self.setEnabled(got is not None)
        if got is not None:
            self._fill(got)
        warning = "" if got is None else compression_warning(got, offered)
        if got is not None and not offered:
            warning = f"The system does not report the formats of this camera. {warning}"
        self.warning.setText(warning.strip())
        self.warning.setVisible(bool(warning))

    def _fill(self, got: Format) -> None:
        codes = dict.fromkeys(f.code for f in (*self._offered, got))
        sizes = sorted(
            {(f.width, f.height) for f in self._of(got.code)} | {(got.width, got.height)}
        )
        rates = sorted({f.rate_hz for f in self._of(got.code, got.width)} | {got.rate_hz})
        kinds = {code: Format(code, 0, 0, 0.0).compressed for code in codes}
        words = {True: "compressed", False: "uncompressed"}
        _fill(self._code, {f"{c} ({words[kinds[c]]})": c for c in codes}, got.code)
        _fill(
            self._size,
            {f"{w} x {h} pixels": (w, h) for w, h in sizes},
            (got.width, got.height),
        )
        _fill(self._rate, {f"{hz:g} images/s": hz for hz in rates}, got.rate_hz)

    def _of(self, code: str, width: int = 0) -> list[Format]:
        return [f for f in self._offered if f.code == code and width in (0, f.width)]

    def _on_chosen(self, box: QComboBox) -> None:
        """Choose the format nearest to the three selections; the one changed last is kept."""
        code, (width, height), rate = (
            b.currentData() for b in (self._code, self._size, self._rate)
        )

        def agrees(f: Format) -> tuple[bool, bool, float]:
            same = f.code == code, (f.width, f.height) == (width, height)
            first, second = reversed(same) if box is self._size else same
            return first, second, -abs(f.rate_hz - rate)

        best = max(self._offered, key=agrees)
        self.chosen.emit(best)


def _fill(box: QComboBox, items: dict[str, object], chosen: object) -> None:
    """Offer items and select the one in use, without emitting a signal."""
    if [box.itemText(row) for row in range(box.count())] != list(items):
        box.clear()
        for text, value in items.items():
            box.addItem(text, value)
    box.setCurrentIndex(list(items.values()).index(chosen))
    box.setEnabled(len(items) > 1)
