"""Dialogs for saving an image or a movie."""

from __future__ import annotations

from dataclasses import dataclass

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QDialog,
    QDialogButtonBox,
    QDoubleSpinBox,
    QFormLayout,
    QHBoxLayout,
    QVBoxLayout,
    QWidget,
)

from app.widgets.inputs import ComboBox, DoubleSpinBox, SpinBox
from app.widgets.naming import named
from gelpolight_core.translation import tr

LARGEST_PX = 8000
LARGEST_MOVIE_PX = 3840


@dataclass(frozen=True, slots=True)
class ImageChoice:
    """Which image to save.

    Attributes
    ----------
    what : str
        ``surface`` or ``views``: all views, as shown on the screen.
    size : (width, height)
        In pixels; of the surface only.
    transparent : bool
        Whether the surface has no background.
    """

    what: str
    size: tuple[int, int]
    transparent: bool = False


@dataclass(frozen=True, slots=True)
class MovieChoice:
    """Which movie to save.

    Attributes
    ----------
    what : str
        ``turntable`` or ``recording``.
    size : (width, height)
        In pixels.
    rate_hz, seconds : float
        Frames per second, and duration of one turn.
    """

    what: str
    size: tuple[int, int]
    rate_hz: float
    seconds: float


class _SizeDialog(QDialog):
    """A choice with a size in pixels."""

    chosen = Signal(object)

    def __init__(self, name: str, title: str, size: QSize, largest: int, parent: QWidget) -> None:
        super().__init__(parent)
        named(self, f"view3d.{name}.dialog", title)
        self.setWindowTitle(title)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.what = named(ComboBox(), f"view3d.{name}.what", tr("Content"))
        self._width, self._height = SpinBox(), SpinBox()
        named(self._width, f"view3d.{name}.width", tr("Width"))
        named(self._height, f"view3d.{name}.height", tr("Height"))
        for box, value in ((self._width, size.width()), (self._height, size.height())):
            box.setRange(64, largest)
            box.setValue(value)
            box.setSuffix(tr(" px"))
        row = QHBoxLayout()
        row.addWidget(self._width)
        row.addWidget(self._height)
        self.form = QFormLayout()
        self.form.addRow(tr("Save"), self.what)
        self.form.addRow(tr("Size"), row)
        buttons = QDialogButtonBox(
            QDialogButtonBox.StandardButton.Save | QDialogButtonBox.StandardButton.Cancel
        )
        buttons.accepted.connect(self._accept)
        buttons.rejected.connect(self.reject)
        column = QVBoxLayout(self)
        column.addLayout(self.form)
        column.addWidget(buttons)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return self._width.value(), self._height.value()

    def enable_size(self, on: bool) -> None:
        """Enable or disable the size."""
        self._width.setEnabled(on)
        self._height.setEnabled(on)

    @property
    def choice(self) -> object:
        """The current settings."""
        raise NotImplementedError

    def _accept(self) -> None:
        self.chosen.emit(self.choice)
        self.accept()


class ImageDialog(_SizeDialog):
    """Lets the user save the surface in any size, or all views as they are.

    Parameters
    ----------
    size : QSize
        Size on the screen.
    kinds : tuple of str
        Some of ``surface`` and ``views``.

    Signals
    -------
    chosen(object)
        An ImageChoice.
    """

    def __init__(self, size: QSize, kinds: tuple[str, ...], *, parent: QWidget) -> None:
        super().__init__("image", tr("Save an image"), 2 * size, LARGEST_PX, parent)
        words = {
            "surface": tr("The surface in 3D"), "views": tr("All views, as on the screen"),
        }  # fmt: skip
        for kind in kinds:
            self.what.addItem(words[kind], kind)
        self._transparent = named(
            QCheckBox(tr("Transparent background")),
            "view3d.image.transparent",
            tr("Transparent background"),
        )
        self.form.addRow("", self._transparent)
        self.what.currentIndexChanged.connect(self._follow)
        self._follow()

    @property
    def choice(self) -> ImageChoice:
        """The current settings."""
        return ImageChoice(self.what.currentData(), self.size_px, self._transparent.isChecked())

    def _follow(self) -> None:
        sized = self.what.currentData() == "surface"
        self.enable_size(sized)
        self._transparent.setEnabled(sized)


class MovieDialog(_SizeDialog):
    """Lets the user save a movie of a turntable or of the open recording.

    Signals
    -------
    chosen(object)
        A MovieChoice.
    """

    def __init__(self, size: QSize, *, recording: bool, parent: QWidget) -> None:
        super().__init__("movie", tr("Save a movie"), size, LARGEST_MOVIE_PX, parent)
        self.what.addItem(tr("Turntable: one full turn of the surface"), "turntable")
        if recording:
            self.what.addItem(tr("The recording, frame by frame"), "recording")
        self._rate = self._number("rate", tr("Frames per second"), 15.0, 1.0, 60.0, "")
        self._seconds = self._number("seconds", tr("Duration"), 8.0, 1.0, 120.0, tr(" s"))
        self.form.addRow(tr("Frames per second"), self._rate)
        self.form.addRow(tr("Duration of one turn"), self._seconds)
        self.what.currentIndexChanged.connect(
            lambda: self._seconds.setEnabled(self.what.currentData() == "turntable")
        )

    @staticmethod
    def _number(
        name: str, accessible: str, value: float, low: float, high: float, unit: str
    ) -> QDoubleSpinBox:
        box = named(DoubleSpinBox(), f"view3d.movie.{name}", accessible)
        box.setRange(low, high)
        box.setDecimals(0)
        box.setValue(value)
        box.setSuffix(unit)
        return box

    @property
    def choice(self) -> MovieChoice:
        """The current settings."""
        return MovieChoice(
            self.what.currentData(), self.size_px, self._rate.value(), self._seconds.value()
        )
