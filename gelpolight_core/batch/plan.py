"""The frames of a run: those of recordings, and images, each with its own result name."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError
from gelpolight_core.recording.matching import recording_notes, require_match
from gelpolight_core.recording.reader import Recording, is_recording
from gelpolight_core.recording.recording import ENDING
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.images import SUFFIXES
from gelpolight_core.translation import tr

DIGITS = 6
"""Least number of digits of a frame number in the name of its result."""


@dataclass(frozen=True, slots=True)
class Job:
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
class Selection:
    """Selection of frames of every recording, and of images of every folder.

    Attributes
    ----------
    first, end : int, int or None
        From `first`, counted from 0, up to but not including `end`; None means to the last.
    every : int
        Step: the first of these, and every n-th after it.
    """

    first: int = 0
    end: int | None = None
    every: int = 1

    def of(self, count: int) -> range:
        """Return the selected indices for a number of frames."""
        return range(self.first, count if self.end is None else min(self.end, count), self.every)


@dataclass(frozen=True, slots=True)
class _Images:
    """Images of one folder."""

    folder: Path
    names: tuple[str, ...]
    output: str

    def __len__(self) -> int:
        return len(self.names)

    @property
    def stems(self) -> Iterator[str]:
        return (_joined(self.output, os.path.splitext(name)[0]) for name in self.names)

    def job(self, index: int) -> Job:
        path = self.folder / self.names[index]
        output = _joined(self.output, os.path.splitext(self.names[index])[0])
        try:
            found = path.stat()
        except OSError:  # the worker reports why it cannot be read
            return Job(path, None, output, "")
        return Job(path, None, output, f"{found.st_size} {found.st_mtime_ns}")


@dataclass(frozen=True, slots=True)
class _Frames:
    """Frames of a recording; if it cannot be opened, a single frame that reports this."""

    path: Path
    output: str
    started: str = ""
    numbers: NDArray[np.int64] = field(default_factory=lambda: np.zeros(1, np.int64))

    def __len__(self) -> int:
        return len(self.numbers)

    @property
    def stems(self) -> Iterator[str]:
        yield f"{self.output}/"

    def job(self, index: int) -> Job:
        output = f"{self.output}/{self.path.stem}_{index:0{DIGITS}d}"
        return Job(self.path, index, output, frame_stamp(self.started, self.numbers[index]))


@dataclass(frozen=True, slots=True)
class BatchPlan:
    """The frames of a run; none of them has been read yet.

    Attributes
    ----------
    sources : tuple
        Recordings, and image folders.
    selection : Selection
        Which of their frames.
    notes : tuple of str
        Notes for the user.
    """

    sources: tuple[_Images | _Frames, ...]
    selection: Selection
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Return the number of frames."""
        return sum(len(self.selection.of(len(source))) for source in self.sources)

    def __iter__(self) -> Iterator[Job]:
        """Yield the frames one by one."""
        for source in self.sources:
            for index in self.selection.of(len(source)):
                yield source.job(index)

    @property
    def folders(self) -> set[str]:
        """The folders of the results, relative to the folder of the run."""
        return {source.output for source in self.sources}


def plan_batch(
    inputs: Sequence[Path], out: Path, calibration: Calibration, selection: Selection
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
    selection : Selection
        Which frames.

    Raises
    ------
    InputError
        If an input does not exist or lies in `out`, a recording has another sensor or size, two
        results would have the same name, or there are no frames.
    """
    found = _Found(out.resolve(), calibration)
    for path in inputs:
        found.take(path.absolute())
    plan = BatchPlan(tuple(found.sources), selection, tuple(found.notes))
    if not len(plan):
        raise InputError(
            tr("There are no frames to reconstruct"),
            where=", ".join(map(str, inputs)),
            advice=tr("Choose recordings, images (PNG or TIFF) or folders of them"),
        )
    _refuse_twins(plan)
    return plan


class _Found:
    """Collects the contents of the inputs."""

    def __init__(self, out: Path, calibration: Calibration) -> None:
        self._out, self._calibration = out, calibration
        self.sources: list[_Images | _Frames] = []
        self.notes: list[str] = []

    def take(self, path: Path) -> None:
        """Add an input given by the user."""
        resolved = path.resolve()
        if not resolved.exists():
            raise InputError(
                tr("The file or folder does not exist"),
                where=str(path),
                advice=tr("Check the name"),
            )
        if resolved.is_relative_to(self._out):
            raise InputError(
                tr("The input is inside the folder of the results"),
                where=str(path),
                advice=tr("Choose another folder for the results"),
            )
        if resolved.is_dir():
            self._take_folder(path, resolved.name)
        elif _seems_recording(path):
            self._take_recording(path, "")
        elif self.sources and _goes_on(self.sources[-1], path):
            before = self.sources.pop()
            assert isinstance(before, _Images)
            self.sources.append(_Images(path.parent, (*before.names, path.name), ""))
        else:
            self.sources.append(_Images(path.parent, (path.name,), ""))

    def _take_folder(self, folder: Path, output: str) -> None:
        """Add a folder and its subfolders; hidden ones are left out."""
        images, recordings, folders, others = [], [], [], 0
        with os.scandir(folder) as entries:
            for entry in entries:
                if entry.name.startswith("."):
                    continue
                if entry.is_dir(follow_symlinks=False):
                    folders.append(entry.name)
                elif entry.name.lower().endswith(SUFFIXES):
                    images.append(entry.name)
                elif entry.name.lower().endswith(ENDING):
                    recordings.append(entry.name)
                else:
                    others += 1
        if images:
            self.sources.append(_Images(folder, tuple(sorted(images)), output))
        for name in sorted(recordings):
            self._take_recording(folder / name, output)
        if others:
            self.notes.append(
                tr(
                    "{folder}: {n} files are neither PNG, TIFF nor recordings and were left out"
                ).format(folder=folder, n=others)
            )
        for name in sorted(folders):
            if (folder / name).resolve() != self._out:
                self._take_folder(folder / name, _joined(output, name))

    def _take_recording(self, path: Path, output: str) -> None:
        output = _joined(output, path.stem)
        try:
            recording = Recording.open(path)
        except InputError:  # the single frame of this source reports the reason
            self.sources.append(_Frames(path, output))
            return
        with recording:
            require_match(recording, self._calibration)
            self.notes += [f"{path}: {note}" for note in recording_notes(recording)]
            self.sources.append(_Frames(path, output, recording.header.started, recording.numbers))


def frame_stamp(started: str, number: int) -> str:
    """Return the stamp of a recorded frame: start time of the recording, and frame number."""
    return f"{started} {number}"


def _seems_recording(path: Path) -> bool:
    return path.suffix.lower() == ENDING or is_recording(path)


def _goes_on(source: _Images | _Frames, path: Path) -> bool:
    """Return whether an image is in the same folder as the previous one."""
    return isinstance(source, _Images) and not source.output and source.folder == path.parent


def _refuse_twins(plan: BatchPlan) -> None:
    # Some file systems ignore upper and lower case.
    names = Counter(stem.casefold() for source in plan.sources for stem in source.stems)
    twins = [name for name, count in names.items() if count > 1]
    frames = {
        f"{source.output}/{source.path.stem}".casefold(): len(source)
        for source in plan.sources
        if isinstance(source, _Frames)
    }
    for name in names:  # an image may have the same name as a frame of a recording next to it
        stem, _, number = name.rpartition("_")
        if stem not in frames or not number.isdecimal():
            continue
        index = int(number)
        if number == f"{index:0{DIGITS}d}" and index in plan.selection.of(frames[stem]):
            raise InputError(
                tr("An image has the same name as the result of a frame: {name}").format(name=name),
                where=tr("INPUT"),
                advice=tr("Process its folder and the recording in separate runs"),
            )
    if twins:
        raise InputError(
            tr("Two inputs would have results named {name}").format(name=twins[0]),
            where=tr("INPUT"),
            advice=tr("Give their common folder instead, or use a separate folder for each run"),
        )


def _joined(folder: str, name: str) -> str:
    return f"{folder}/{name}" if folder else name
