"""The work of a worker on one frame, for a local process and for a cluster.

:func:`work` depends only on its arguments and the files they name, and may be called in any process
any number of times: the same frame gives the same bits, and existing files are replaced by
identical ones.
"""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path, PurePosixPath

import cv2
import numpy as np

from gelpolight_core import __version__
from gelpolight_core.batch.ledger import FrameRow
from gelpolight_core.batch.plan import Job, frame_stamp
from gelpolight_core.batch.settings import BatchSettings, require_same
from gelpolight_core.batch.stopping import shall_stop
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.errors import InputError
from gelpolight_core.export.heightmap_files import write_heightmap
from gelpolight_core.image.linear import LinearImage, linear_image
from gelpolight_core.measurement.indenter_tools import measure_heightmap
from gelpolight_core.measurement.trust import judged
from gelpolight_core.reconstruction.height_map import Flag, HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.recording.reader import Recording
from gelpolight_core.recording.recording import RecordedFrame
from gelpolight_core.session.images import read_image, require_colour
from gelpolight_core.translation import tr


@dataclass(frozen=True, slots=True)
class Halt:
    """Why no worker can continue, such as a full disk; the parts of an :class:`InputError`."""

    found: str
    where: str
    advice: str

    @classmethod
    def because(cls, error: InputError) -> Halt:
        """Return an error in a form that can be sent between processes."""
        return cls(error.found, error.where, error.advice)

    def error(self) -> InputError:
        """Return the original error."""
        return InputError(self.found, where=self.where, advice=self.advice)


Outcome = FrameRow | Halt


def work(settings: BatchSettings, out: Path, jobs: Sequence[Job]) -> list[Outcome]:
    """Reconstruct frames and write their files; return the rows for the ledger.

    Parameters
    ----------
    settings : BatchSettings
        Settings of the run; the calibration is read once per process.
    out : Path
        Folder of the run, created with the same settings.
    jobs : sequence of Job
        The frames. No frame is begun after one that halts the run, or after a request to stop.
    """
    with _one_at_a_time:
        try:
            worker = _worker(settings, out)
        except InputError as error:
            return [Halt.because(error)]
        outcomes: list[Outcome] = []
        for job in jobs:
            if shall_stop(out):
                break
            outcomes.append(worker.work(job))
            if isinstance(outcomes[-1], Halt):
                break
        return outcomes


def failed(job: Job, error: str, *, seconds: float = 0.0, ours: bool = False) -> FrameRow:
    """Return the row of a frame without a result."""
    return FrameRow(
        job.output, job.stamp, str(job.path), job.index, seconds=seconds, error=error, ours=ours
    )


# Two threads of a process must not run the compiled loops at the same time.
_one_at_a_time = threading.Lock()


@lru_cache(maxsize=1)
def _worker(settings: BatchSettings, out: Path) -> _FrameWorker:
    return _FrameWorker(settings, out)


class _FrameWorker:
    """Reconstructs frames of one calibration."""

    def __init__(self, settings: BatchSettings, out: Path) -> None:
        cv2.setNumThreads(1)  # each process has one core
        # Also checks that this process can see the folder of the results.
        require_same(replace(settings, program=__version__), out)
        self._settings, self._out = settings, out
        self._recording: Recording | None = None
        self._mark: tuple[int, ...] = ()
        calibration = read_calibration(settings.calibration)
        if calibration.identity != settings.identity:
            raise InputError(
                tr("The calibration was replaced while in use"),
                where=str(settings.calibration),
                advice=tr("Restore it, or start a separate run with the new one"),
            )
        self._reconstructor = Reconstructor(
            calibration, model=settings.model, effort=settings.effort, workers=1
        )

    def work(self, job: Job) -> Outcome:
        """Reconstruct a frame, and write its files."""
        began = time.process_time()
        try:
            row, heightmap = self._reconstruct(job)
            self._write(heightmap, job)
        except InputError as error:
            return failed(job, str(error), seconds=time.process_time() - began)
        except _CannotWrite as error:
            return error.halt
        except Exception:  # an internal error in one frame must not stop all others
            seconds = time.process_time() - began
            return failed(job, traceback.format_exc(), seconds=seconds, ours=True)
        return replace(row, seconds=time.process_time() - began)

    def _reconstruct(self, job: Job) -> tuple[FrameRow, HeightMap]:
        row = FrameRow(job.output, job.stamp, str(job.path), job.index)
        if job.index is None:
            image = read_image(job.path, response=self._reconstructor.calibration.response)
            require_colour(image, where=str(job.path))
        else:
            image, row = self._recorded(job, job.index, row)
        shape = self._settings.shape
        health = self._reconstructor.health(image.rgb, name=job.name)
        heightmap = self._reconstructor.depth(
            image.rgb,
            name=job.name,
            normals=shape is None,
            uncertainty=shape is not None,
            health=health,
        )
        return _described(row, heightmap, shape), heightmap

    def _recorded(self, job: Job, index: int, row: FrameRow) -> tuple[LinearImage, FrameRow]:
        try:
            frame = self._frame(job, index)
        except InputError:
            if not self._forget_changed():
                raise
            frame = self._frame(job, index)
        response = self._reconstructor.calibration.response
        image = linear_image(frame.rgb, job.name, response=response)
        return image, replace(row, number=frame.number, time_s=frame.time_s)

    def _frame(self, job: Job, index: int) -> RecordedFrame:
        recording = self._opened(job.path)
        if index >= len(recording):
            raise InputError(
                tr("Frame {n} does not exist").format(n=index),
                where=str(job.path),
                advice=tr("Copy the recording again"),
            )
        frame = recording.frame(index)
        if frame_stamp(recording.header.started, frame.number) != job.stamp:
            raise InputError(
                tr("Frame {n} has changed since the run was started").format(n=index),
                where=str(job.path),
                advice=tr("Repeat the command, which reads the recording again"),
            )
        return frame

    def _opened(self, path: Path) -> Recording:
        """Return an open recording; its frames are used one by one, and finding them takes time."""
        if self._recording is None or self._recording.path != path:
            self._close()
            mark = _file_mark(path)
            self._recording, self._mark = Recording.open(path), mark
        return self._recording

    def _forget_changed(self) -> bool:
        """Close a recording whose file has changed since it was opened; return whether it had.

        Workers of a cluster live long; but a growing recording is not searched again for every
        frame.
        """
        if self._recording is None or self._mark == _file_mark(self._recording.path):
            return False
        self._close()
        return True

    def _close(self) -> None:
        if self._recording is not None:
            self._recording.close()
            self._recording = None

    def _write(self, heightmap: HeightMap, job: Job) -> None:
        folder = self._out / PurePosixPath(job.output).parent
        try:
            write_heightmap(heightmap, folder, formats=self._settings.formats)
        except InputError as error:
            if isinstance(error.__cause__, OSError):
                raise _CannotWrite(Halt.because(error)) from error
            raise  # an error of this frame only, such as a surface without any part to mesh


class _CannotWrite(Exception):
    """The disk refuses files, also those of other frames."""

    def __init__(self, halt: Halt) -> None:
        super().__init__(halt)
        self.halt = halt


def _file_mark(path: Path) -> tuple[int, ...]:
    """Return a mark that changes when a file is replaced or modified."""
    try:
        found = path.stat()
    except OSError:  # opening it gives the error message
        return ()
    return found.st_ino, found.st_size, found.st_mtime_ns


def _described(row: FrameRow, heightmap: HeightMap, shape: str | None) -> FrameRow:
    """Return a row with the summary of a height map."""
    inside = (heightmap.flags & int(Flag.OUTSIDE)) == 0
    known = inside & np.isfinite(heightmap.depth_mm)
    depth_mm = heightmap.depth_mm[known].astype(np.float64)
    flagged = heightmap.flags[inside] != 0
    row = replace(
        row,
        max_depth_mm=float(depth_mm.max()) if depth_mm.size else None,
        volume_mm3=float(depth_mm.sum()) * heightmap.pitch_mm**2,
        flagged_share=float(flagged.mean()) if flagged.size else None,
        notes=heightmap.notes,
    )
    if shape is None:
        return row
    try:
        measurement = judged(measure_heightmap(heightmap, shape=shape), heightmap)
    except InputError as error:  # nothing is pressed, or something else
        return replace(row, notes=(*row.notes, error.found))
    return replace(row, measured=measurement.as_json())
