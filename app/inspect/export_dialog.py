"""Dialog for the export settings."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QDialogButtonBox,
    QFileDialog,
    QFormLayout,
    QLineEdit,
    QWidget,
)

from app.inspect.export import ExportChoice, format_words
from app.widgets.buttons import push_button
from app.widgets.dialog import Dialog
from app.widgets.inputs import SpinBox
from app.widgets.layout import hbox
from app.widgets.naming import named
from gelpolight_core.translation import tr

FIRST_FORMATS = ("npz", "tif")
FOLDER_WIDTH = 360


class ExportDialog(Dialog):
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
        kinds = QDialogButtonBox.StandardButton
        super().__init__(
            parent, "inspect.export.dialog", tr("Export the depth"), kinds.Save | kinds.Cancel,
            once=True,
        )  # fmt: skip
        self._beside = folder.parent
        self._formats: dict[str, QCheckBox] = {}
        for name, words in format_words().items():
            box = named(QCheckBox(words), f"inspect.export.{name}", words)
            box.setChecked(name in FIRST_FORMATS)
            box.toggled.connect(self._check)
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
        browse = push_button(
            "inspect.export.browse", tr("Browse…"), self._browse, accessible=tr("Choose folder")
        )
        form.addRow(tr("Folder"), hbox((self._folder, 1), browse))
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
        form.addRow(self._range, hbox(self._first, self._last))
        form.setRowVisible(self._range, count > 1)
        self.accepted.connect(lambda: self.chosen.emit(self.choice))
        self.fill(*self._formats.values(), form)
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
        self.buttons.button(QDialogButtonBox.StandardButton.Save).setEnabled(good)

    def _browse(self) -> None:
        chosen = QFileDialog.getExistingDirectory(self, tr("Folder"), self._folder.text())
        if chosen:
            self._folder.setText(chosen)
