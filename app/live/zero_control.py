"""Zero: corrects a background shift with the present background of the untouched sensor."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from PySide6.QtCore import QObject

from app.program.calibration_entries import ENDING
from app.program.context import AppContext
from app.program.jobs import BackgroundJob, JobQueue
from app.program.workspace import Workspace
from gelpolight_core.base.finding import Verdict, worst_of
from gelpolight_core.base.user_name import user_name
from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
from gelpolight_core.reconstruction.background_shift import (
    BackgroundShift,
    background_shift,
    with_zero,
)

from .live_session import LiveSession

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
