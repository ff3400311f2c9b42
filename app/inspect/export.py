"""Files of the Inspect page: depth, recordings, profiles, references and images."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from pathlib import Path

from PySide6.QtCore import QBuffer, QByteArray, QObject
from PySide6.QtWidgets import QDialogButtonBox, QWidget

from app.live.banner import SHOWN_FROM
from app.live.live_depth import LiveDepth
from app.program.context import AppContext
from app.program.file_dialogs import ask_open, ask_save
from app.program.jobs import BackgroundJob, JobQueue
from app.sources.recording import RecordingSource
from app.sources.source import SourceFrame
from app.views.map.quantities import ReferenceMap
from app.views.surface.scene_export import ImageChoice, image_dialog
from app.widgets.actions import make_action
from app.widgets.dialog import Dialog
from app.widgets.forms import Form, form_dialog
from gelpolight_core.base.atomic_write import write_atomically
from gelpolight_core.base.form_fields import folder as folder_field
from gelpolight_core.base.form_fields import number, several, switch
from gelpolight_core.health.frame_health import refuse_meaningless
from gelpolight_core.measurement.map_processing import subtract_map
from gelpolight_core.output.formats import HEIGHT_MAP_FORMATS, PROFILE_FORMATS
from gelpolight_core.output.heightmap_files import write_heightmap, write_profile
from gelpolight_core.output.raster import read_npz
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor

from .inspect_views import InspectViews


class FileActions(QObject):
    """The actions of the page that write an image or a table, or read a reference.

    Parameters
    ----------
    depth : LiveDepth
        Holds the open source and the current frame.
    views : InspectViews
        Source of the screenshots.
    owner : QWidget
        The page.
    context : AppContext
        Shared by all pages.
    """

    def __init__(
        self, depth: LiveDepth, views: InspectViews, owner: QWidget, *, context: AppContext
    ) -> None:
        super().__init__(owner)
        self._depth, self._views = depth, views
        self._owner, self._context = owner, context
        add = partial(make_action, owner)
        tip = "Save the profile of the section line as a table (CSV)"
        self.profile_action = add("inspect.save_profile", "Profile…", self.save_profile, tip=tip)
        tip, keys = "Save an image of the views or of the surface in any size", ("Ctrl+Shift+P",)
        name, text, sign = "inspect.screenshot", "Screenshot…", "picture"
        self.image_action = add(name, text, self.screenshot, keys=keys, icon_name=sign, tip=tip)
        ways = {"hold": "Use the current frame", "load": "Load from a file…", "clear": "Clear"}
        add_choices = views.surface.menu.add_choices
        add_choices("Reference for differences", "reference", ways, self.take_reference)

    # Profiles

    def save_profile(self) -> None:
        """Ask for a file, and write the profile of the section line as a table."""
        profile = self._views.section.cut.profile
        if profile is None:
            self._context.toasts.show("There is no profile yet.", "warn")
            return
        last = self._depth.last
        file = "profile-processed.csv" if last is not None and last.processed else "profile.csv"
        patterns = ";;".join(f"{f.title} (*{f.suffix})" for f in PROFILE_FORMATS.values())
        kind, title = ("table", patterns), "Save the profile"
        self._save(kind, title, file, partial(write_profile, profile))

    # The 3D view

    def take_reference(self, how: str) -> None:
        """Compare with the current frame (``hold``), a file (``load``) or nothing (``clear``)."""
        if how == "clear":
            self._views.compare_with(None)
        elif how == "load":
            settings, title = self._context.settings, "Load a reference"
            if path := ask_open(self._owner, settings, "height_map", title, "Height map (*.npz)"):
                self.load_reference(path)
        elif self.hold_reference():
            self._views.compare_with(self._views.processing.reference)

    def hold_reference(self) -> bool:
        """Keep the height map of now, as reconstructed, as the reference. Return whether it is."""
        last = self._depth.last
        if last is None or last.raw is None:
            text = "There is no depth to use as a reference yet."
            self._context.toasts.show(text, "warn")
            return False
        name = last.frame.name or f"frame {last.frame.number}"
        self._views.processing.show_reference(ReferenceMap(replace(last.raw, source=name), name))
        return True

    def load_reference(self, path: Path) -> None:
        """Compare with a height map that was exported as npz."""
        with self._context.toasts.errors():
            heightmap = read_npz(path)
            if self._depth.last is not None and self._depth.last.raw is not None:
                subtract_map(self._depth.last.raw, heightmap)
            self._views.compare_with(ReferenceMap(heightmap, path.name))

    # Screenshots

    def screenshot(self) -> None:
        """Ask which image to save and in which size."""
        kinds = ("views",) if self._views.surface.view is None else ("views", "surface")
        image_dialog(self._views.size(), kinds, self.save_screenshot, self._owner).open()

    def save_screenshot(self, choice: ImageChoice) -> None:
        """Ask for a file, and save all views or the surface in it."""
        if choice.what == "surface":
            self._views.surface.saving.ask_image_file(choice)
            return
        data = QByteArray()
        self._views.grab().toImage().save(QBuffer(data), b"PNG")
        name = f"inspect-{datetime.now().astimezone():%Y-%m-%d-%H%M%S}.png"
        kind, title = ("picture", "Image (*.png)"), "Save the image"
        write = partial(write_atomically, writer=lambda file: file.write(data.data()))
        self._save(kind, title, name, write)

    def _save(
        self, kind: tuple[str, str], title: str, name: str, write: Callable[[Path], object]
    ) -> None:
        """Ask for a file of a kind (folder and patterns), and write it."""
        folder, patterns = kind
        path = ask_save(self._owner, self._context.settings, folder, title, name, patterns)
        if path is not None:
            with self._context.toasts.errors():
                write(path)
                self._context.toasts.show(f"Saved to {path}")


MOST_FRAMES = 10_000_000
ABOUT_STRIDE = "Meshes use every n-th row and column, which makes smaller files"


@dataclass(frozen=True, slots=True)
class ExportChoice:
    """Export settings: formats, destination, and frames of a recording."""

    formats: tuple[str, ...] = several(
        ("npz", "tif"), "Formats", {key: format.label for key, format in HEIGHT_MAP_FORMATS.items()}
    )
    stride: int = number(1, "Mesh: every n-th node", 1, 16, tip=ABOUT_STRIDE)
    folder: str = folder_field("", "Folder", relative=True)
    part: bool = switch(False, "", "Frames", "Export a range of frames")
    first: int = number(1, "First frame", 1, MOST_FRAMES, when=lambda c: c.part)
    last: int = number(1, "Last frame", 1, MOST_FRAMES, when=lambda c: c.part)

    @property
    def frames(self) -> range | None:
        """Frame numbers in the recording, from 0. None: the current frame."""
        return range(self.first - 1, self.last) if self.part else None


def frame_name(frame: SourceFrame, *, processed: bool = False) -> str:
    """Return the name of an exported frame: that of its file, or the same as in an exported range.

    Parameters
    ----------
    frame : SourceFrame
        The frame.
    processed : bool, optional
        Whether its height map is processed. The name then says so.
    """
    name = Path(frame.name).stem or f"frame-{frame.number:05d}"
    return f"{name}-processed.png" if processed else f"{name}.png"


def export_frame(
    heightmap: HeightMap, choice: ExportChoice, name: str, progress: Callable[[float], None]
) -> list[Path]:
    """Write the height map of one frame, and report the progress from the beginning."""
    named, folder, written = replace(heightmap, source=name), Path(choice.folder), list[Path]()
    for kind in choice.formats:
        progress(max(len(written) / len(choice.formats), SHOWN_FROM))
        written += write_heightmap(named, folder, formats=kind, stride=choice.stride)
    return written


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
        If the recording, a frame or a file cannot be used, or a frame's depth is meaningless.
    """
    from gelpolight_core.output.recording.recording_reader import Recording

    assert choice.frames is not None
    written: list[Path] = []
    with Recording.open(path) as recording:
        for done, index in enumerate(choice.frames):
            progress(done / len(choice.frames))
            name = f"{path.stem}-{index:05d}.png"
            heightmap = reconstructor.depth(recording.frame(index).rgb, name=name)
            if heightmap.health is not None:
                refuse_meaningless(heightmap.health, where=name)
            written += write_heightmap(
                heightmap, Path(choice.folder), formats=choice.formats, stride=choice.stride
            )
    return written


def export_dialog(
    folder: Path,
    chosen: Callable[[ExportChoice], object],
    *,
    count: int = 0,
    at: int = 0,
    parent: QWidget,
) -> Dialog:
    """Return a dialog that lets the user choose formats, folder and frames.

    Parameters
    ----------
    folder : Path
        Proposed folder.
    chosen : callable
        Called with the choice.
    count : int
        Number of frames of the open recording. 0: there is none.
    at : int
        The current frame of the recording.
    parent : QWidget
        The page.
    """
    last = max(count, 1)
    form = Form(ExportChoice(folder=str(folder), first=at + 1, last=last), "inspect.export")
    form.inputs["folder"].setMinimumWidth(360)
    form.show_row("part", count > 1)
    dialog = form_dialog(form, "inspect.export.dialog", "Export the depth", chosen, parent)
    form.limit("first", 1, last)

    def check() -> None:
        form.limit("last", form.value.first, last)
        save = dialog.buttons.button(QDialogButtonBox.StandardButton.Save)
        save.setEnabled(bool(form.value.formats))

    form.changed.connect(check)
    check()
    return dialog


class ExportControl(QObject):
    """Exports the depth of the shown frame, or of frames of a recording.

    Parameters
    ----------
    depth : LiveDepth
        Holds the open source and the current frame.
    jobs : JobQueue
        Runs the export.
    owner : QWidget
        Gets the action.
    context : AppContext
        Holds the settings and the messages.
    """

    def __init__(
        self, depth: LiveDepth, jobs: JobQueue, owner: QWidget, *, context: AppContext
    ) -> None:
        super().__init__(owner)
        self._depth, self._jobs = depth, jobs
        self._owner, self._context = owner, context
        keys, tip = ("Ctrl+E",), "Write the depth to files"
        self.action = make_action(
            owner, "inspect.export", "Export…", self.ask, keys=keys, icon_name="export", tip=tip
        )

    def ask(self) -> None:
        """Ask what to export, and export it."""
        last = self._depth.last
        if last is None or last.heightmap is None:
            fault = None if last is None else last.fault
            text = "There is no depth to export yet." if fault is None else fault.line
            self._context.toasts.show(text, "warn")
            return
        source, count, at = self._depth.live.source, 0, 0
        if isinstance(source, RecordingSource):
            now = source.playback()
            count, at = now.count, now.position
        folder = self._context.settings.folder("height_map") / "depth"
        export_dialog(folder, self.run, count=count, at=at, parent=self._owner).open()

    def run(self, choice: ExportChoice) -> None:
        """Write the chosen files."""
        last, source = self._depth.last, self._depth.live.source
        reconstructor = self._depth.reconstructor
        self._context.settings.keep_folder("height_map", Path(choice.folder).parent)
        if choice.frames is not None and isinstance(source, RecordingSource):
            if reconstructor is None:
                return
            # The live processing is paused: a reconstructor serves one thread.
            self._depth.live.suspend(True)
            work = partial(export_recording, source.path, reconstructor, choice)
        elif last is not None and last.heightmap is not None:
            name = frame_name(last.frame, processed=bool(last.processed))
            work = partial(export_frame, last.heightmap, choice, name)
        else:
            return
        self._jobs.submit(
            BackgroundJob(
                "Exporting",
                work,
                self._on_exported,
                lambda sentence: self._context.toasts.show(sentence, "fail"),
                ended=lambda: self._depth.live.suspend(False),
            )
        )

    def _on_exported(self, files: list[Path]) -> None:
        text = f"{len(files)} files written to {files[0].parent}"
        self._context.toasts.show(text)
