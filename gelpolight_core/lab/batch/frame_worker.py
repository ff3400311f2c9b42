"""The work of a worker on one frame, for a local process and for a cluster.

:func:`reconstruct_job` depends only on its arguments and the files they name, and may be called in
any process any number of times: the same frame gives the same bits, and existing files are replaced
by identical ones.
"""

from __future__ import annotations

import threading
import time
import traceback
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from gelpolight_core.base.errors import InputError, Remedy, as_input_error
from gelpolight_core.base.version import __version__
from gelpolight_core.calibration.calibration_file import read_calibration
from gelpolight_core.image.linear_image import linear_image
from gelpolight_core.measurement.map_reliability import with_map_findings
from gelpolight_core.measurement.object_measurement import measure_heightmap
from gelpolight_core.output.heightmap_files import write_heightmap
from gelpolight_core.output.recording.recording_format import RecordedFrame
from gelpolight_core.output.recording.recording_reader import Recording
from gelpolight_core.reconstruction.height_map import Flag, HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.session_images import read_colours

from .batch_plan import BatchSettings, FrameJob, frame_stamp
from .batch_table import TABLE, FrameRow


def reconstruct_job(settings: BatchSettings, out: Path, job: FrameJob) -> FrameRow:
    """Reconstruct a frame, write its files and return its row for the results.

    Parameters
    ----------
    settings : BatchSettings
        Settings of the run; the calibration is read once per process.
    out : Path
        Folder of the run, in which the folders of the results exist.
    job : FrameJob
        The frame.

    Raises
    ------
    InputError
        If no worker can continue, such as on a full disk. Errors of the frame are in its row.
    """
    with _one_at_a_time:
        return _worker(settings, out).work(job)


def failed_row(
    settings: BatchSettings, job: FrameJob, error: str, *, internal: bool = False
) -> FrameRow:
    """Return the row of a frame without a result."""
    return replace(_row(settings, job), error=error, internal=internal)


def _row(settings: BatchSettings, job: FrameJob) -> FrameRow:
    return FrameRow(
        job.output, str(job.path), settings.calibration_id, settings.origin(job), job.index
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
        if settings.program != __version__:
            text = f"A worker has version {__version__} of this program, not {settings.program}"
            raise InputError(text, "--workers", Remedy.CLUSTER)
        if not (out / TABLE).is_file():
            raise InputError("A worker cannot see the folder of the results", out, Remedy.CLUSTER)
        self._settings, self._out = settings, out
        self._recording: Recording | None = None
        calibration = read_calibration(settings.calibration)
        if calibration.identity != settings.calibration_id:
            text = "The calibration was replaced while in use"
            raise InputError(text, settings.calibration, Remedy.START_NEW)
        self._reconstructor = Reconstructor(
            calibration, model=settings.model, effort=settings.effort, workers=1
        )

    def work(self, job: FrameJob) -> FrameRow:
        """Reconstruct a frame, and write its files."""
        began = time.process_time()
        heightmap: HeightMap | None = None
        try:
            row, heightmap = self._reconstruct(job)
            folder = (self._out / job.output).parent
            write_heightmap(heightmap, folder, formats=self._settings.formats)
        except InputError as error:
            if heightmap is not None and isinstance(error.__cause__, OSError):
                raise  # the disk refuses files, also those of other frames
            row = failed_row(self._settings, job, str(error))
        except Exception as error:  # an error in one frame must not stop all others
            fault = as_input_error(error)
            text = traceback.format_exc() if fault is None else str(fault)
            row = failed_row(self._settings, job, text, internal=fault is None)
        return replace(row, seconds=time.process_time() - began)

    def _reconstruct(self, job: FrameJob) -> tuple[FrameRow, HeightMap]:
        row = _row(self._settings, job)
        response = self._reconstructor.calibration.response
        if job.index is None:
            image = read_colours(job.path, response=response)
        else:
            frame = self._recorded(job, job.index)
            image = linear_image(frame.rgb, job.name, response=response)
            row = replace(row, number=frame.number, time_s=frame.time_s)
        shape = self._settings.measure
        heightmap = self._reconstructor.depth(
            image.rgb,
            name=job.name,
            normals=shape is None,
            uncertainty=shape is not None,
            health=self._reconstructor.health(image.rgb, name=job.name, loss=image.loss),
        )
        return _described(row, heightmap, shape), heightmap

    def _recorded(self, job: FrameJob, index: int) -> RecordedFrame:
        """Return a frame, also of a file that was replaced while the worker lives."""
        with suppress(InputError):
            if self._recording is not None and self._recording.path == job.path:
                return _frame(self._recording, job, index)
        if self._recording is not None:
            self._recording.close()
            self._recording = None
        self._recording = Recording.open(job.path)
        return _frame(self._recording, job, index)


def _frame(recording: Recording, job: FrameJob, index: int) -> RecordedFrame:
    started, numbers = recording.header.started, recording.numbers
    if index < len(numbers) and frame_stamp(started, numbers[index]) == job.stamp:
        return recording.frame(index)
    text = f"Frame {index} has changed since the run was started"
    advice = "Repeat the command, which reads the recording again"
    raise InputError(text, job.path, advice)


def _described(row: FrameRow, heightmap: HeightMap, shape: str | None) -> FrameRow:
    """Return a row with the summary of a height map."""
    inside = (heightmap.flags & int(Flag.OUTSIDE)) == 0
    valid = inside & np.isfinite(heightmap.depth_mm)
    depth_mm = heightmap.depth_mm[valid].astype(np.float64)
    flagged = heightmap.flags[inside] != 0
    row = replace(
        row,
        max_depth_mm=float(depth_mm.max()) if depth_mm.size else None,
        volume_mm3=float(depth_mm.sum()) * heightmap.pitch_mm**2,
        flagged_share=float(flagged.mean()) if flagged.size else None,
        notes=tuple(finding.text for finding in heightmap.findings),
    )
    if shape is None:
        return row
    try:
        measurement = with_map_findings(measure_heightmap(heightmap, shape=shape), heightmap)
    except InputError as error:  # nothing is pressed, or something else
        return replace(row, notes=(*row.notes, error.found))
    return replace(row, measured=measurement.as_json())
