"""The calibration of the page: the one in use, a fitting one, or the virtual sensor's."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QWidget

from app.program.calibration_entries import CalibrationEntry
from app.program.calibration_status import put_into_use
from app.program.context import AppContext
from app.program.jobs import BackgroundJob, JobQueue
from app.program.prepare import prepare, prepared
from gelpolight_core.session.camera_settings import settings_of_texts

from .next_step_advice import CalibrationTarget

if TYPE_CHECKING:
    from gelpolight_core.reconstruction.reconstructor import Reconstructor

# From this size on kernels may be compiled, which takes a minute the first time.
WARM_FROM = 0.2


class CalibrationChoice(QObject):
    """Reads the calibration in use in the background.

    Parameters
    ----------
    jobs : JobQueue
        Runs the reading.
    owner : QWidget
        The page.
    on_loaded : callable
        Called with the reconstructors of the calibration in use, for live and for frozen images.
        None if there is none, or until it is read.
    context : AppContext
        Holds the workspace.
    """

    def __init__(
        self,
        jobs: JobQueue,
        owner: QWidget,
        on_loaded: Callable[[Any, Any], object],
        *,
        context: AppContext,
    ) -> None:
        super().__init__(owner)
        self._loaded = on_loaded
        self._jobs, self._owner, self._context = jobs, owner, context
        self._state: tuple[object, ...] = ()
        self._reading: BackgroundJob | None = None
        self.entries: tuple[CalibrationEntry, ...] = ()
        context.requests.calibrations_changed.connect(self._on_changed)

    def _on_changed(self) -> None:
        if self._reading is not None and self._reading.over:  # stopped or failed
            self._state = ()
        self.refresh()

    def refresh(self) -> None:
        """Update from the library, and read the calibration in use if it changed."""
        self.entries = ()
        with self._context.toasts.errors():
            self.entries = self._context.workspace.entries()
        used = next((e for e in self.entries if e.in_use and e.summary is not None), None)
        state = () if used is None or used.summary is None else (used.path, used.summary.identity)
        if state == self._state:
            return
        self._state = state
        if used is not None:
            self._read(used.path)
        # The previous calibration must not be used under the new name, even if reading fails.
        self._loaded(None, None)

    @property
    def is_reading(self) -> bool:
        """Whether the calibration in use is being read. False after an error."""
        return self._reading is not None and not self._reading.over

    def set_camera_reference(self, live: Reconstructor | None) -> None:
        """Require the camera settings that a calibration was made with."""
        texts = {} if live is None else live.calibration.provenance.camera_settings
        self._context.cameras.set_reference("the calibration", settings_of_texts(texts))

    def use_matching_calibration(self, serial: str, size: tuple[int, int] | None) -> None:
        """Put the newest validated calibration for such images into use. Empty and None fit all.

        If none is validated, it is the newest one that did not fail.
        """
        fitting = [e for e, target in self.candidates() if target.fits(serial, size)]
        for entry in sorted(fitting, key=lambda entry: not entry.validated)[:1]:
            put_into_use(entry.path, self._owner, context=self._context)

    def candidates(self) -> list[tuple[CalibrationEntry, CalibrationTarget]]:
        """Return the calibrations that did not fail, without those made with another camera."""
        info, is_other = self._context.source.info, self._context.cameras.is_other
        return [
            (entry, CalibrationTarget(entry.summary.serial, entry.summary.image_size))
            for entry in self.entries
            if entry.summary is not None
            and not entry.failed
            and not is_other(entry.summary.camera, info)
        ]

    def _read(self, path: Path) -> None:
        def work(progress: Callable[[float], None]) -> object:
            from app.views.map.shading import warm_up
            from gelpolight_core.calibration.calibration_file import read_calibration
            from gelpolight_core.reconstruction.reconstructor import Reconstructor

            calibration = read_calibration(path)
            live = Reconstructor(calibration, effort="fast")
            progress(WARM_FROM)
            live.warm_up()
            warm_up()
            return path, live, Reconstructor(calibration)

        def done(loaded: tuple[Path, object, object]) -> None:
            if self._reading is not reading:
                return  # requested again: the file may have changed
            self._reading = None
            if self._state[:1] == loaded[:1]:
                self._loaded(*loaded[1:])

        title = "Preparing the calibration"
        failed = partial(self._context.toasts.show, verdict="fail")
        reading = BackgroundJob(title, work, done, failed)
        self._reading = reading
        self._jobs.submit(reading)


def use_virtual_calibration(jobs: JobQueue, *, context: AppContext) -> None:
    """Put the calibration of the virtual sensor into use, unless one of it is in use.

    If this version has not made it yet, it is made in the background.
    """
    bench, workspace = context.source.bench, context.workspace
    if bench is None:
        return
    camera = bench.design.camera
    expected = bench.design.serial, (camera.width_px, camera.height_px)
    with context.toasts.errors():
        used = next((e.summary for e in workspace.entries() if e.in_use), None)
        if used is not None and (used.serial, used.image_size) == expected:
            return

    def use(path: Path) -> None:
        with context.toasts.errors():
            workspace.use(workspace.import_calibration(path))
        context.requests.calibrations_changed.emit()

    if (path := prepared()) is not None:
        use(path)
    else:
        jobs.submit(BackgroundJob("Preparing the virtual sensor", prepare, use))
