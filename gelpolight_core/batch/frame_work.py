"""What a worker does with a frame; the same for a process of this machine and for a cluster's.

:func:`work` depends on nothing but its arguments and the files they name, and may be called in any
process any number of times: the same frame gives the same bits, and files that are there already
are replaced by equal ones.
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
from gelpolight_core.measurement.indenter_tools import measure_heightmap
from gelpolight_core.reconstruction.heightmap import Flag, HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.recording.reader import Recording
from gelpolight_core.recording.recording import RecordedFrame
from gelpolight_core.session.picture import Picture, linear_picture
from gelpolight_core.session.session import read_picture, require_colour
from gelpolight_core.translation import tr


@dataclass(frozen=True, slots=True)
class Halt:
    """Why no worker can go on, such as a full disk; the parts of an :class:`InputError`."""

    found: str
    where: str
    advice: str

    @classmethod
    def because(cls, error: InputError) -> Halt:
        """Return an error in a form that goes from one process to another."""
        return cls(error.found, error.where, error.advice)

    def error(self) -> InputError:
        """Return the error again."""
        return InputError(self.found, where=self.where, advice=self.advice)


Outcome = FrameRow | Halt


def work(settings: BatchSettings, out: Path, jobs: Sequence[Job]) -> list[Outcome]:
    """Reconstruct frames and write their files; return what is to be noted of each.

    Parameters
    ----------
    settings : BatchSettings
        What it is done with; the calibration is read once in a process.
    out : Path
        Folder of the run, which was begun with the same settings.
    jobs : sequence of Job
        The frames. Behind one that halts the run none is begun, nor once it shall stop.
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
    """Return the row of a frame that has no result."""
    return FrameRow(
        job.output, job.stamp, str(job.path), job.index, seconds=seconds, error=error, ours=ours
    )


# Two threads of a process may not enter the compiled loops together.
_one_at_a_time = threading.Lock()


@lru_cache(maxsize=1)
def _worker(settings: BatchSettings, out: Path) -> _FrameWorker:
    return _FrameWorker(settings, out)


class _FrameWorker:
    """Reconstructs frames of one calibration."""

    def __init__(self, settings: BatchSettings, out: Path) -> None:
        cv2.setNumThreads(1)  # each process has a core of its own
        # Also tells whether this process sees the folder that the results shall lie in.
        require_same(replace(settings, program=__version__), out)
        self._settings, self._out = settings, out
        self._recording: Recording | None = None
        self._mark: tuple[int, ...] = ()
        calibration = read_calibration(settings.calibration)
        if calibration.identity != settings.identity:
            raise InputError(
                tr("the calibration was replaced while it was in use"),
                where=str(settings.calibration),
                advice=tr("Put it back, or begin a run of its own with the new one"),
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
        except Exception:  # one frame's fault of ours shall not keep a million others waiting
            seconds = time.process_time() - began
            return failed(job, traceback.format_exc(), seconds=seconds, ours=True)
        return replace(row, seconds=time.process_time() - began)

    def _reconstruct(self, job: Job) -> tuple[FrameRow, HeightMap]:
        row = FrameRow(job.output, job.stamp, str(job.path), job.index)
        if job.index is None:
            picture = read_picture(job.path, response=self._reconstructor.calibration.response)
            require_colour(picture, where=str(job.path))
        else:
            picture, row = self._recorded(job, job.index, row)
        shape = self._settings.shape
        heightmap = self._reconstructor.depth(
            picture.rgb, name=job.name, normals=shape is None, uncertainty=shape is not None
        )
        return _described(row, heightmap, shape), heightmap

    def _recorded(self, job: Job, index: int, row: FrameRow) -> tuple[Picture, FrameRow]:
        try:
            frame = self._frame(job, index)
        except InputError:
            if not self._forget_changed():
                raise
            frame = self._frame(job, index)
        response = self._reconstructor.calibration.response
        picture = linear_picture(frame.rgb, job.name, response=response)
        return picture, replace(row, number=frame.number, time_s=frame.time_s)

    def _frame(self, job: Job, index: int) -> RecordedFrame:
        recording = self._opened(job.path)
        if index >= len(recording):
            raise InputError(
                tr("there is no frame {n}").format(n=index),
                where=str(job.path),
                advice=tr("Copy the recording again"),
            )
        frame = recording.frame(index)
        if frame_stamp(recording.header.started, frame.number) != job.stamp:
            raise InputError(
                tr("frame {n} is another one than when the run was begun").format(n=index),
                where=str(job.path),
                advice=tr("Give the command again, which looks at the recording anew"),
            )
        return frame

    def _opened(self, path: Path) -> Recording:
        """Return a recording; its frames come one by one, and finding them takes a while."""
        if self._recording is None or self._recording.path != path:
            self._close()
            mark = _file_mark(path)
            self._recording, self._mark = Recording.open(path), mark
        return self._recording

    def _forget_changed(self) -> bool:
        """Close a recording whose file is another than when it was opened; return whether it was.

        A cluster's workers live long; but one that grows is not searched anew for every frame.
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
            raise  # this frame's own, such as a surface without any part to be meshed


class _CannotWrite(Exception):
    """The disk refuses files, those of other frames as well."""

    def __init__(self, halt: Halt) -> None:
        super().__init__(halt)
        self.halt = halt


def _file_mark(path: Path) -> tuple[int, ...]:
    """Return what tells that a file was replaced or written on."""
    try:
        found = path.stat()
    except OSError:  # opening it says why, in words
        return ()
    return found.st_ino, found.st_size, found.st_mtime_ns


def _described(row: FrameRow, heightmap: HeightMap, shape: str | None) -> FrameRow:
    """Return a row with what the summary says of a height map."""
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
        measurement = measure_heightmap(heightmap, shape=shape)
    except InputError as error:  # nothing is pressed, or something else
        return replace(row, notes=(*row.notes, error.found))
    return replace(row, measured=measurement.as_json())
