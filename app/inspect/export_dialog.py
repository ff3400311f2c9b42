"""Dialog for the export settings."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from app.inspect.export import ExportChoice, format_words
from app.widgets.inputs import SpinBox
from app.widgets.naming import named
from gelpolight_core.translation import tr

FIRST_FORMATS = ("npz", "tif")
FOLDER_WIDTH = 360


class ExportDialog(QDialog):
    """Lets the user choose formats, folder and frames.

    Parameters
    ----------
    folder : Path
        Proposed folder.
    count : int
        Number of frames of the open recording. 0: there is none.
    at : int
        The current frame of the recording.

    Signals
    -------
    chosen(object)
        An ExportChoice.
    """

    chosen = Signal(object)

    def __init__(self, folder: Path, *, count: int = 0, at: int = 0, parent: QWidget) -> None:
        super().__init__(parent)
        named(self, "inspect.export.dialog", tr("Export"))
        self.setWindowTitle(tr("Export the depth"))
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self._beside = folder.parent
        self._formats: dict[str, QCheckBox] = {}
        column = QVBoxLayout(self)
        for name, words in format_words().items():
            box = named(QCheckBox(words), f"inspect.export.{name}", words)
            box.setChecked(name in FIRST_FORMATS)
            box.toggled.connect(self._check)
            column.addWidget(box)
            self._formats[name] = box
        form = QFormLayout()
        self._stride = named(SpinBox(), "inspect.export.stride", tr("Use every n-th node"))
        self._stride.setRange(1, 16)
        self._stride.setToolTip(
            tr("Meshes use every n-th row and column, which makes smaller files")
        )
        form.addRow(tr("Mesh: every n-th node"), self._stride)
        self._folder = named(QLineEdit(str(folder)), "inspect.export.folder", tr("Folder"))
        self._folder.setMinimumWidth(FOLDER_WIDTH)
        self._folder.textChanged.connect(self._check)
        browse = named(QPushButton(tr("Browse…")), "inspect.export.browse", tr("Choose folder"))
        browse.clicked.connect(self._browse)
        row = QHBoxLayout()
        row.addWidget(self._folder, 1)
        row.addWidget(browse)
        form.addRow(tr("Folder"), row)
        self._range = named(
            QCheckBox(tr("Frames")), "inspect.export.range", tr("Export a range of frames")
        )
        self._first, self._last = SpinBox(), SpinBox()
        named(self._first, "inspect.export.first", tr("First frame"))
        named(self._last, "inspect.export.last", tr("Last frame"))
        for box, value in ((self._first, at + 1), (self._last, count)):
            box.setRange(1, max(count, 1))
            box.setValue(value)
            box.setEnabled(False)
            self._range.toggled.connect(box.setEnabled)
        self._range.toggled.connect(self._check)
        self._first.valueChanged.connect(self._last.setMinimum)
        span = QHBoxLayout()
        span.addWidget(self._first)
        span.addWidget(self._last)
        form.addRow(self._range, span)
        form.setRowVisible(self._range, count > 1)
        column.addLayout(form)
        self._buttons = QDialogButtonBox(
            QDialogButtonBox.StandardButton.Save | QDialogButtonBox.StandardButton.Cancel
        )
        self._buttons.accepted.connect(self._accept)
        self._buttons.rejected.connect(self.reject)
        column.addWidget(self._buttons)
        self._check()

    @property
    def choice(self) -> ExportChoice:
        """The current settings."""
        frames = None
        if self._range.isChecked():
            frames = self._first.value() - 1, self._last.value() - 1
        return ExportChoice(
            # A name without a path is a folder next to the proposed one.
            folder=self._beside / Path(self._folder.text()).expanduser(),
            formats=tuple(name for name, box in self._formats.items() if box.isChecked()),
            stride=self._stride.value(),
            frames=frames,
        )

    def _check(self) -> None:
        good = bool(self.choice.formats) and bool(self._folder.text().strip())
        self._buttons.button(QDialogButtonBox.StandardButton.Save).setEnabled(good)

    def _browse(self) -> None:
        chosen = QFileDialog.getExistingDirectory(self, tr("Folder"), self._folder.text())
        if chosen:
            self._folder.setText(chosen)

    def _accept(self) -> None:
        self.chosen.emit(self.choice)
        self.accept()
