"""Zero: corrects a background shift with the present background of the untouched sensor."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from PySide6.QtCore import QObject

from app.context.context import AppContext
from app.live.session import LiveSession
from app.services.jobs import Job, Jobs
from app.workspace.entries import ENDING
from app.workspace.workspace import Workspace
from gelpolight_core.calibration.file import read_calibration, write_calibration
from gelpolight_core.errors import InputError
from gelpolight_core.finding import Verdict, worst_of
from gelpolight_core.io.user import user_name
from gelpolight_core.reconstruction.background_shift import (
    BackgroundShift,
    background_shift,
    zeroed,
)

FRAMES = 8
SUFFIX = "-zero"
"""End of the name of a calibration set to zero."""


class ZeroControl(QObject):
    """Sets zero with the next images of a session.

    Parameters
    ----------
    live : LiveSession
        The images, and the owner of this object.
    jobs : Jobs
        Runs the computation.
    context : AppContext
        Holds the library and the messages.
    """

    def __init__(self, live: LiveSession, jobs: Jobs, *, context: AppContext) -> None:
        super().__init__(live)
        self._live, self._jobs, self._context = live, jobs, context

    def set_zero(self) -> None:
        """Use the present background of the untouched sensor as the zero reference."""
        if self._live.stream is None or self._context.workspace.in_use is None:
            text = "Zero needs a camera and a calibration in use."
            self._context.toasts.show(text, "warn")
        else:
            self._live.capture(FRAMES, self._on_captured, self._on_failed, aborted=self._on_aborted)

    def _on_captured(self, frames: list[NDArray[Any]]) -> None:
        workspace = self._context.workspace
        used = workspace.in_use
        if used is not None:
            self._jobs.submit(
                Job(
                    "Setting zero",
                    lambda _progress: zero_calibration(workspace, used, frames),
                    self._on_zeroed,
                    self._on_failed,
                )
            )

    def _on_aborted(self, _sentence: str) -> None:
        text = "Zero was not set because the camera was released. Set it again."
        self._context.toasts.show(text, "warn")

    def _on_failed(self, sentence: str) -> None:
        self._context.toasts.show(sentence, "fail")

    def _on_zeroed(self, done: tuple[Path, BackgroundShift]) -> None:
        path, before = done
        self._context.requests.calibrations_changed.emit()
        worst = worst_of(before.quality.figures)
        text = "Zero is set. The original calibration is kept."
        if worst is not None:
            text += " " + f"The background had changed: {worst.stated}."
        # A calibration that was itself made by Zero is overwritten. Only the original remains.
        undo = ("Undo", lambda: self._use(original_of(path)))
        verdict = Verdict.PASS if worst is None else Verdict.WARN
        self._context.toasts.show(text, verdict, actions=(undo,))

    def _use(self, path: Path) -> None:
        try:
            self._context.workspace.use(path)
        except InputError as error:
            self._on_failed(str(error))
        self._context.requests.calibrations_changed.emit()


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
    changed = zeroed(calibration, frames, operator=user_name(), made=time)
    path = origin.with_name(f"{origin.stem}{SUFFIX}{ENDING}")
    write_calibration(changed, path)
    workspace.use(path)
    return path, before


def original_of(used: Path) -> Path:
    """Return the original of a calibration set to zero. Any other is its own original."""
    origin = used.with_name(f"{used.stem.removesuffix(SUFFIX)}{ENDING}")
    return origin if origin.is_file() else used
