"""What the buttons of the page do beside looking: zero, export, screenshots, profiles."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from datetime import datetime
from pathlib import Path
from typing import Any

from PySide6.QtCore import QBuffer, QObject, QTimer
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QFileDialog, QWidget

from app.inspect.export import ExportChoice, export_frame, export_recording
from app.inspect.export_dialog import ExportDialog
from app.inspect.link import LiveLink
from app.inspect.screenshot import ScreenshotDialog
from app.inspect.views import Views
from app.inspect.zero import FRAMES, Zeroed, zero_calibration
from app.shell.actions import make_action
from app.shell.context import AppContext
from app.shell.jobs import Job, Jobs
from app.sources.recording import RecordingSource
from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import write_atomically
from gelpolight_core.export.profile_file import write_profile
from gelpolight_core.quality import Verdict
from gelpolight_core.translation import tr

POLL_MS = 60


class Deeds(QObject):
    """The actions of the page that end in a file.

    Parameters
    ----------
    link : LiveLink
        With what is shown.
    views : Views
        Are pictured.
    jobs : Jobs
        Do what takes long.
    owner : QWidget
        The page.
    context : AppContext
        The program's.
    """

    def __init__(
        self, link: LiveLink, views: Views, jobs: Jobs, owner: QWidget, *, context: AppContext
    ) -> None:
        super().__init__(owner)
        self._link, self._views, self._jobs = link, views, jobs
        self._owner, self._context = owner, context
        self._capture: Future[list[Any]] | None = None
        self._timer = QTimer(self)
        self._timer.setInterval(POLL_MS)
        self._timer.timeout.connect(self._poll)
        self.zero_action = make_action(
            owner, "inspect.zero", tr("Zero"), self.zero, keys=("Ctrl+0",), icon_name="zero",
            tip=tr("Take the picture of now for the untouched membrane (Ctrl+0)"),
        )  # fmt: skip
        self.export_action = make_action(
            owner, "inspect.export", tr("Export…"), self.export, keys=("Ctrl+E",),
            icon_name="export", tip=tr("Write the depth to files (Ctrl+E)"),
        )  # fmt: skip
        self.picture_action = make_action(
            owner, "inspect.screenshot", tr("Screenshot…"), self.screenshot,
            keys=("Ctrl+Shift+P",), icon_name="picture",
            tip=tr("A picture of the views, in any size (Ctrl+Shift+P)"),
        )  # fmt: skip
        views.section.save_wanted.connect(self.save_profile)
        link.switched.connect(self._forget_capture)

    # Zero

    def zero(self) -> None:
        """Set the calibration to zero on the untouched sensor."""
        used = self._context.workspace.in_use
        if self._link.stream is None or used is None:
            self._tell(tr("Zero needs a camera and a calibration in use."), "warn")
        elif self._capture is None:
            self._capture = self._link.stream.capture(FRAMES)
            self._timer.start()

    def _forget_capture(self) -> None:
        """Nobody waits for the frames of a camera that was left."""
        self._capture = None
        self._timer.stop()

    def _poll(self) -> None:
        if self._capture is None or not self._capture.done():
            return
        future, self._capture = self._capture, None
        self._timer.stop()
        used = self._context.workspace.in_use
        if future.cancelled() or used is None:
            return
        error = future.exception()
        if error is not None:
            self._tell(str(error), "fail")
            return
        frames = [frame.rgb for frame in future.result()]
        workspace = self._context.workspace
        self._jobs.submit(
            Job(
                tr("Setting to zero"),
                lambda _tell: zero_calibration(workspace, used, frames),
                self._on_zeroed,
                lambda sentence: self._tell(sentence, "fail"),
            )
        )

    def _on_zeroed(self, done: Zeroed) -> None:
        self._context.requests.calibrations_changed.emit()
        poor = [f for f in done.before.quality.figures if f.verdict is not Verdict.PASS]
        text = tr("Set to zero; the calibration that it was made of is kept.")
        if poor:
            text += " " + tr("The background had moved: {what} {v:.2g} {unit}.").format(
                what=poor[0].label, v=poor[0].value, unit=poor[0].unit
            )
        # Where it was set to zero before, that one is overwritten: only the original is there.
        undo = (tr("Undo"), lambda: self._use(done.origin))
        self._tell(text, "warn" if poor else "pass", actions=(undo,))

    def _use(self, path: Path) -> None:
        try:
            self._context.workspace.use(path)
        except InputError as error:
            self._tell(str(error), "fail")
        self._context.requests.calibrations_changed.emit()

    # Export

    def export(self) -> None:
        """Ask what to export, and do it."""
        if self._link.last is None or self._link.last.heightmap is None:
            self._tell(tr("There is no depth to export yet."), "warn")
            return
        source, count, at = self._source(), 0, 0
        if isinstance(source, RecordingSource):
            now = source.playback()
            count, at = now.count, now.position
        folder = self._context.settings.last_folder / "depth"
        dialog = ExportDialog(folder, count=count, at=at, parent=self._owner)
        dialog.chosen.connect(self.run_export)
        dialog.open()

    def run_export(self, choice: ExportChoice) -> None:
        """Write what was chosen."""
        last, source = self._link.last, self._source()
        reconstructor = self._link.reconstructor
        self._context.settings.last_folder = choice.folder.parent
        if choice.frames is not None and isinstance(source, RecordingSource):
            path = source.path
            if reconstructor is None:
                return
            # The page's own processing rests: a reconstructor serves one thread.
            self._link.rest(True)

            def work(tell: Any) -> list[Path]:
                return export_recording(path, reconstructor, choice, tell)

        elif last is not None and last.heightmap is not None:
            heightmap, name = last.heightmap, f"frame-{last.frame.number:05d}.png"

            def work(tell: Any) -> list[Path]:
                return export_frame(heightmap, choice, name)

        else:
            return
        self._jobs.submit(
            Job(
                tr("Exporting"),
                work,
                self._on_exported,
                lambda sentence: self._tell(sentence, "fail"),
                ended=lambda: self._link.rest(False),
            )
        )

    def _on_exported(self, files: list[Path]) -> None:
        self._tell(
            tr("{n} files written to {folder}").format(n=len(files), folder=files[0].parent), "pass"
        )

    def save_profile(self) -> None:
        """Ask for a place, and write the profile as a table."""
        profile = self._views.section.cut.profile
        if profile is None:
            self._tell(tr("There is no profile yet."), "warn")
            return
        proposed = self._context.settings.last_folder / "profile.csv"
        chosen, _ = QFileDialog.getSaveFileName(
            self._owner, tr("Save the profile"), str(proposed), tr("Table (*.csv)")
        )
        if chosen:
            self._write(Path(chosen), lambda path: write_profile(profile, path))

    # Screenshots

    def screenshot(self) -> None:
        """Ask what to picture and how large."""
        size = self._views.size()
        has_surface = self._views.surface.view is not None
        dialog = ScreenshotDialog(size.width(), size.height(), has_surface, parent=self._owner)
        dialog.chosen.connect(self.take_picture)
        dialog.open()

    def take_picture(self, what: str, width: int, height: int) -> None:
        """Picture the surface (``surface``) or all views (``views``), and ask for a place."""
        view = self._views.surface.view
        if what == "surface" and view is not None:
            image: QImage = view.picture(width, height)
        else:
            image = self._views.grab().toImage()
        name = f"inspect-{datetime.now().astimezone():%Y-%m-%d-%H%M%S}.png"
        chosen, _ = QFileDialog.getSaveFileName(
            self._owner,
            tr("Save the picture"),
            str(self._context.settings.last_folder / name),
            tr("Picture (*.png)"),
        )
        if chosen:
            data = png_bytes(image)
            self._write(
                Path(chosen), lambda path: write_atomically(path, lambda file: file.write(data))
            )

    def _write(self, path: Path, write: Callable[[Path], object]) -> None:
        self._context.settings.last_folder = path.parent
        try:
            write(path)
        except InputError as error:
            self._tell(str(error), "fail")
            return
        self._tell(tr("Written to {path}").format(path=path), "pass")

    def _source(self) -> object:
        return None if self._link.stream is None else self._link.stream.source

    def _tell(self, text: str, kind: str, **more: Any) -> None:
        self._context.toasts.show(text, kind, **more)


def png_bytes(image: QImage) -> bytes:
    """Return a picture as PNG."""
    buffer = QBuffer()
    buffer.open(QBuffer.OpenModeFlag.WriteOnly)
    image.save(buffer, "PNG")
    return bytes(buffer.data().data())
