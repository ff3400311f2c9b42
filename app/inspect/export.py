"""The export of height maps: the button, the dialog, and the files of a frame or a recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QDialogButtonBox,
    QFileDialog,
    QFormLayout,
    QLineEdit,
    QWidget,
)

from app.context.context import AppContext
from app.live.depth import LiveDepth
from app.services.jobs import Job, Jobs
from app.sources.recording import RecordingSource
from app.sources.source import Frame, Source
from app.widgets.actions import make_action
from app.widgets.buttons import push_button
from app.widgets.dialog import Dialog
from app.widgets.inputs import SpinBox
from app.widgets.layout import hbox
from app.widgets.naming import named
from gelpolight_core.export.heightmap_files import FORMATS, write_heightmap
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.translation import tr


@dataclass(frozen=True, slots=True)
class ExportChoice:
    """The export settings of the user.

    Attributes
    ----------
    folder : Path
        Destination folder.
    formats : tuple of str
        Some of FORMATS.
    stride : int
        Meshes use every n-th row and column.
    frames : (first, last) or None
        Frame numbers in the recording, from 0. None: the current frame.
    """

    folder: Path
    formats: tuple[str, ...]
    stride: int = 1
    frames: tuple[int, int] | None = None


def format_words() -> dict[str, str]:
    """Return the use of each format."""
    words = {
        "npz": tr("npz: all data, for NumPy"),
        "tif": tr("tif: depth, 32-bit float"),
        "png": tr("png: depth, 16-bit with its scale"),
        "gsf": tr("gsf: depth, for Gwyddion"),
        "csv": tr("csv: depth as a table, for spreadsheets"),
        "xyz": tr("xyz: one point per line, for point cloud programs"),
        "vtp": tr("vtp: mesh, for ParaView"),
        "ply": tr("ply: mesh with normals"),
        "stl": tr("stl: mesh only, for 3D printing"),
        "glb": tr("glb: glTF mesh in metres, for 3D viewers and web pages"),
    }
    return {name: words.get(name, name) for name in FORMATS}


def frame_name(frame: Frame, source: Source | None, *, processed: bool = False) -> str:
    """Return the name of an exported frame: of a recording, the same as in the export of a range.

    Parameters
    ----------
    frame : Frame
        The frame.
    source : Source or None
        Its source.
    processed : bool, optional
        Whether its height map is processed. The name then says so.
    """
    name = f"frame-{frame.number:05d}"
    if frame.index is not None and source is not None:
        name = f"{source.name}-{frame.index:05d}"
    return f"{name}-processed.png" if processed else f"{name}.png"


def export_frame(heightmap: HeightMap, choice: ExportChoice, name: str) -> list[Path]:
    """Write the height map of one frame."""
    named = replace(heightmap, source=name)
    return write_heightmap(named, choice.folder, formats=choice.formats, stride=choice.stride)


def export_recording(
    path: Path,
    reconstructor: Reconstructor,
    choice: ExportChoice,
    progress: Callable[[float], None],
) -> list[Path]:
    """Reconstruct frames of a recording one after the other and write them.

    Parameters
    ----------
    path : Path
        The recording.
    reconstructor : Reconstructor
        No other thread may use it at the same time.
    choice : ExportChoice
        With the frames.
    progress : callable
        Called with the progress (0 to 1). An exception from it stops the work between two frames.

    Raises
    ------
    InputError
        If the recording, a frame or a file cannot be used.
    """
    from gelpolight_core.recording.reader import Recording

    assert choice.frames is not None
    written: list[Path] = []
    recording = Recording.open(path)
    try:
        indices: Sequence[int] = range(choice.frames[0], choice.frames[1] + 1)
        for done, index in enumerate(indices):
            progress(done / len(indices))
            frame = recording.frame(index)
            heightmap = reconstructor.depth(frame.rgb, name=f"{path.stem}-{index:05d}.png")
            written += write_heightmap(
                heightmap, choice.folder, formats=choice.formats, stride=choice.stride
            )
    finally:
        recording.close()
    return written


FIRST_FORMATS = ("npz", "tif")


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
            parent,
            "inspect.export.dialog",
            tr("Export the depth"),
            kinds.Save | kinds.Cancel,
            once=True,
        )
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
        self._folder.setMinimumWidth(360)
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
        for ends, value in ((self._first, at + 1), (self._last, count)):
            ends.setRange(1, max(count, 1))
            ends.setValue(value)
            ends.setEnabled(False)
            self._range.toggled.connect(ends.setEnabled)
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


class ExportControl(QObject):
    """Exports the depth of a sensor.

    Parameters
    ----------
    depth : LiveDepth
        Holds the open source and the current frame.
    jobs : Jobs
        Runs the export.
    owner : QWidget
        Gets the action.
    context : AppContext
        Holds the settings and the messages.
    """

    def __init__(
        self, depth: LiveDepth, jobs: Jobs, owner: QWidget, *, context: AppContext
    ) -> None:
        super().__init__(owner)
        self._depth, self._jobs = depth, jobs
        self._owner, self._context = owner, context
        self.action = make_action(
            owner, "inspect.export", tr("Export…"), self.ask, keys=("Ctrl+E",),
            icon_name="export", tip=tr("Write the depth to files"),
        )  # fmt: skip

    def ask(self) -> None:
        """Ask what to export, and export it."""
        if self._depth.last is None or self._depth.last.heightmap is None:
            self._context.toasts.show(tr("There is no depth to export yet."), "warn")
            return
        source, count, at = self._depth.live.source, 0, 0
        if isinstance(source, RecordingSource):
            now = source.playback()
            count, at = now.count, now.position
        folder = self._context.settings.folder("height_map") / "depth"
        dialog = ExportDialog(folder, count=count, at=at, parent=self._owner)
        dialog.chosen.connect(self.run)
        dialog.open()

    def run(self, choice: ExportChoice) -> None:
        """Write the chosen files."""
        last, source = self._depth.last, self._depth.live.source
        reconstructor = self._depth.reconstructor
        self._context.settings.keep_folder("height_map", choice.folder.parent)
        if choice.frames is not None and isinstance(source, RecordingSource):
            path = source.path
            if reconstructor is None:
                return
            # The live processing is paused: a reconstructor serves one thread.
            self._depth.live.rest(True)

            def work(progress: Any) -> list[Path]:
                return export_recording(path, reconstructor, choice, progress)

        elif last is not None and last.heightmap is not None:
            heightmap = last.heightmap
            name = frame_name(last.frame, self._depth.live.source, processed=bool(last.processed))

            def work(progress: Any) -> list[Path]:
                return export_frame(heightmap, choice, name)

        else:
            return
        self._jobs.submit(
            Job(
                tr("Exporting"),
                work,
                self._on_exported,
                lambda sentence: self._context.toasts.show(sentence, "fail"),
                ended=lambda: self._depth.live.rest(False),
            )
        )

    def _on_exported(self, files: list[Path]) -> None:
        text = tr("{n} files written to {folder}").format(n=len(files), folder=files[0].parent)
        self._context.toasts.show(text)
