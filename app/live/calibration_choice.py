"""The calibration of the page: the one in use, a fitting one, the virtual sensor's, and zero."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray
from PySide6.QtCore import QObject
from PySide6.QtWidgets import QWidget

from app.program.calibration_entries import ENDING, CalibrationEntry
from app.program.calibration_status import put_into_use
from app.program.context import AppContext
from app.program.jobs import BackgroundJob, JobQueue
from app.program.prepare import prepare, prepared
from app.program.workspace import Workspace
from gelpolight_core.base.finding import Verdict, worst_of
from gelpolight_core.base.user_name import user_name
from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
from gelpolight_core.reconstruction.background_shift import (
    BackgroundShift,
    background_shift,
    with_zero,
)
from gelpolight_core.session.camera_settings import settings_of_texts

from .live_session import LiveSession
from .next_step_advice import CalibrationTarget

FRAMES = 8
SUFFIX = "-zero"
"""End of the name of a calibration set to zero."""


class ZeroControl(QObject):
    """Sets zero with the next images of a session.

    Parameters
    ----------
    live : LiveSession
        The images, and the owner of this object.
    jobs : JobQueue
        Runs the computation.
    context : AppContext
        Holds the library and the messages.
    """

    def __init__(self, live: LiveSession, jobs: JobQueue, *, context: AppContext) -> None:
        super().__init__(live)
        self._live, self._jobs, self._context = live, jobs, context

    def set_zero(self) -> None:
        """Use the present background of the untouched sensor as the zero reference."""
        toasts, workspace = self._context.toasts, self._context.workspace
        used = workspace.in_use
        if self._live.stream is None or used is None:
            toasts.show("Zero needs a camera and a calibration in use.", "warn")
            return
        calibration, failed = used, partial(toasts.show, verdict="fail")
        aborted = "Zero was not set because the camera was released. Set it again."

        def zero(frames: list[NDArray[Any]]) -> None:
            def work(_progress: object) -> tuple[Path, BackgroundShift]:
                return zero_calibration(workspace, calibration, frames)

            self._jobs.submit(BackgroundJob("Setting zero", work, self._on_zeroed, failed))

        self._live.capture(FRAMES, zero, failed, aborted=lambda _: toasts.show(aborted, "warn"))

    def _on_zeroed(self, zeroed: tuple[Path, BackgroundShift]) -> None:
        path, before = zeroed
        context = self._context

        def undo() -> None:
            # A calibration that was itself made by Zero is overwritten. Only the original remains.
            with context.toasts.errors():
                context.workspace.use(original_of(path))
            context.requests.calibrations_changed.emit()

        context.requests.calibrations_changed.emit()
        worst = worst_of(before.quality.figures)
        text = "Zero is set. The original calibration is kept."
        if worst is not None:
            text += f" The background had changed: {worst.stated}."
        verdict = Verdict.PASS if worst is None else Verdict.WARN
        context.toasts.show(text, verdict, actions=(("Undo", undo),))


def zero_calibration(
    workspace: Workspace, used: Path, frames: Sequence[NDArray[Any]]
) -> tuple[Path, BackgroundShift]:
    """Write the calibration in use with the present background, and put it into use.

    The new file is next to the original, which is not changed. Zeroing again replaces the new file.

    Parameters
    ----------
    workspace : Workspace
        Stores both.
    used : Path
        The calibration in use, which may itself be one set to zero.
    frames : sequence of (height, width, 3)
        Images of the untouched sensor.

    Returns
    -------
    path : Path
        The calibration with the present background.
    before : BackgroundShift
        The first image compared with the original background.

    Raises
    ------
    InputError
        If the sensor is touched or the frames cannot be used.
    """
    origin = original_of(used)
    calibration = read_calibration(origin)
    before = background_shift(frames[0], calibration)
    time = datetime.now(UTC).isoformat(timespec="seconds")
    changed = with_zero(calibration, frames, operator=user_name(), made=time)
    path = origin.with_name(f"{origin.stem}{SUFFIX}{ENDING}")
    write_calibration(changed, path)
    workspace.use(path)
    return path, before


def original_of(used: Path) -> Path:
    """Return the original of a calibration set to zero. Any other is its own original."""
    origin = used.with_name(f"{used.stem.removesuffix(SUFFIX)}{ENDING}")
    return origin if origin.is_file() else used


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
        self.entries = self._context.toasts.read_list(self._context.workspace.entries)
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
