"""The export button: writes the depth of the current frame, or of a recording, to files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QWidget

from app.context.context import AppContext
from app.inspect.export import ExportChoice, export_frame, export_recording, frame_name
from app.inspect.export_dialog import ExportDialog
from app.live.depth import LiveDepth
from app.services.jobs import Job, Jobs
from app.sources.recording import RecordingSource
from app.widgets.actions import make_action
from gelpolight_core.translation import tr


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
            name = frame_name(last.frame, source, processed=bool(last.processed))

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
        self._context.toasts.show(text, "pass")
