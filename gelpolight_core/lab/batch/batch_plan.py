"""Plan of a run: frames of recordings and images, each with its own result name."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.safe_reading import cannot_read
from gelpolight_core.base.version import __version__
from gelpolight_core.image.image_file import SUFFIXES, names_of
from gelpolight_core.output.recording.calibration_match import recording_notes, require_match
from gelpolight_core.output.recording.recording_format import ENDING
from gelpolight_core.output.recording.recording_reader import Recording, is_recording
from gelpolight_core.sensor.sensor_calibration import Calibration


@dataclass(frozen=True, slots=True)
class FrameJob:
    """One frame to reconstruct.

    Attributes
    ----------
    path : Path
        The image, or the recording.
    index : int or None
        Index of the frame in the recording, from 0; None for an image.
    output : str
        Its files in the run's folder, without extensions.
    stamp : str
        Distinguishes it from another frame that replaces it later.
    """

    path: Path
    index: int | None
    output: str
    stamp: str

    @property
    def name(self) -> str:
        """Its name in the result."""
        if self.index is None:
            return self.path.name
        return f"{self.output.rpartition('/')[2]}{self.path.suffix}"


@dataclass(frozen=True, slots=True)
class BatchSettings:
    """Settings for every frame of a run.

    Attributes
    ----------
    calibration : Path
        Its file, as every worker finds it; it may move if its identity stays.
    calibration_id : str
        Identity of the calibration.
    model, effort : str
        As for :class:`~gelpolight_core.reconstruction.reconstructor.Reconstructor`.
    formats : tuple of str
        Keys of :data:`~gelpolight_core.output.formats.HEIGHT_MAP_FORMATS`.
    measure : str or None
        The shape measured in every frame; None for no measurement.
    program : str
        Version of the program.
    """

    calibration: Path
    calibration_id: str
    model: str
    effort: str
    formats: tuple[str, ...]
    measure: str | None = None
    program: str = __version__

    def origin(self, job: FrameJob) -> str:
        """Return what a result depends on beside the calibration, in one line."""
        what = self.model, self.effort, *self.formats, self.measure or "", self.program
        return f"{' '.join(what)}; {job.stamp}"


@dataclass(frozen=True, slots=True)
class BatchPlan:
    """The frames of a run, none of which has been read yet.

    Attributes
    ----------
    jobs : tuple of FrameJob
        The frames.
    notes : tuple of str
        Notes for the user.
    """

    jobs: tuple[FrameJob, ...]
    notes: tuple[str, ...] = ()


def plan_batch(
    inputs: Sequence[Path], out: Path, calibration: Calibration, selection: slice
) -> BatchPlan:
    """Find the frames of recordings, images and folders, including subfolders.

    Results of a folder go to a folder of the same name in `out`, with the same subfolders; those of
    a recording to a folder of its name; those of an image given directly to `out`.

    Parameters
    ----------
    inputs : sequence of Path
        Recordings, images, folders.
    out : Path
        Folder of the results; its content is not an input.
    calibration : Calibration
        Must match the recordings.
    selection : slice
        Which frames of each recording and of each folder, counted from 0.

    Raises
    ------
    InputError
        If an input does not exist or lies in `out`, a recording has another sensor or size, two
        results would have the same name, or there are no frames.
    """
    finder = _Finder(out.resolve(), calibration, selection)
    for path in inputs:
        finder.add(path.absolute())
    for folder, names in finder.images_by_folder.items():
        finder.add_images(folder, names, "")
    if not finder.jobs:
        where = ", ".join(map(str, inputs))
        raise InputError("There are no frames to reconstruct", where, Remedy.CHOOSE_IMAGES)
    used: set[str] = set()
    for job in finder.jobs:
        name = job.output.casefold()  # some file systems ignore upper and lower case
        if name in used:
            text = f"Two inputs would have results named {job.output}"
            raise InputError(text, "INPUT", Remedy.SEPARATE_FOLDERS)
        used.add(name)
    return BatchPlan(tuple(finder.jobs), tuple(finder.notes))


class _Finder:
    """Finds the contents of the inputs."""

    def __init__(self, out: Path, calibration: Calibration, selection: slice) -> None:
        self._out, self._calibration, self._selection = out, calibration, selection
        self.images_by_folder: dict[Path, list[str]] = {}
        self.jobs: list[FrameJob] = []
        self.notes: list[str] = []

    def add(self, path: Path) -> None:
        """Add an input given by the user."""
        resolved = path.resolve()
        if not resolved.exists():
            raise InputError("The file or folder does not exist", path, Remedy.CHECK_NAME)
        if resolved.is_relative_to(self._out):
            text = "The input is inside the folder of the results"
            raise InputError(text, path, Remedy.CHOOSE_FOLDER)
        if resolved.is_dir():
            self._add_folder(path, resolved.name)
        elif path.suffix.lower() == ENDING or is_recording(path):
            self._add_recording(path, "")
        else:
            self.images_by_folder.setdefault(path.parent, []).append(path.name)

    def _add_folder(self, folder: Path, output: str) -> None:
        """Add a folder with its subfolders, except hidden ones."""
        for root, folders, files in os.walk(folder, onerror=_raise):
            folders[:] = sorted(
                name
                for name in folders
                if not name.startswith(".") and Path(root, name).resolve() != self._out
            )
            place = str(PurePosixPath(output, Path(root).relative_to(folder).as_posix()))
            names = sorted(name for name in files if not name.startswith("."))
            images = [name for name in names if name.lower().endswith(SUFFIXES)]
            recordings = [name for name in names if name.lower().endswith(ENDING)]
            if images:
                self.add_images(Path(root), images, place)
            for name in recordings:
                self._add_recording(Path(root, name), place)
            if others := [Path(name) for name in names if name not in {*images, *recordings}]:
                count, some = len(others), names_of(others)
                note = f"{root}: {count} files are neither images nor recordings: {some}"
                self.notes.append(note)

    def _add_recording(self, path: Path, output: str) -> None:
        started, numbers = "", np.zeros(1, np.int64)
        try:
            recording = Recording.open(path)
        except InputError:
            pass  # the only frame of this source reports the reason
        else:
            with recording:
                require_match(recording, self._calibration)
                self.notes += [f"{path}: {note}" for note in recording_notes(recording)]
                started, numbers = recording.header.started, recording.numbers
        folder = str(PurePosixPath(output, path.stem))
        for index in range(len(numbers))[self._selection]:
            name = f"{folder}/{path.stem}_{index:06d}"
            self.jobs.append(FrameJob(path, index, name, frame_stamp(started, numbers[index])))

    def add_images(self, folder: Path, names: Sequence[str], output: str) -> None:
        """Add images of a folder with their results in the folder `output` of the run."""
        for name in names[self._selection]:
            path, stamp = folder / name, ""
            with suppress(OSError):  # the worker reports why it cannot be read
                status = path.stat()
                stamp = f"{status.st_size} {status.st_mtime_ns}"
            self.jobs.append(FrameJob(path, None, str(PurePosixPath(output, path.stem)), stamp))


def frame_stamp(started: str, number: int) -> str:
    """Return the stamp of a recorded frame: start time of the recording, and frame number."""
    return f"{started} {number}"


def _raise(error: OSError) -> None:
    raise cannot_read(error, Path(error.filename)) from error
