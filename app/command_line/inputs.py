"""Inputs of the reconstructing commands: images and frames of recordings."""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from tqdm import tqdm

from app.command_line.terminal import say
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.image.linear import LinearImage, linear_image
from gelpolight_core.image.response import CameraResponse
from gelpolight_core.recording.matching import recording_notes, require_match
from gelpolight_core.recording.reader import Recording, is_recording
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.images import read_image, require_colour
from gelpolight_core.translation import tr


@dataclass(frozen=True, slots=True)
class Input:
    """One input image.

    Attributes
    ----------
    name : str
        Its name in the result. Without extension, the name of the result's files.
    stem : str
        The name without its extension.
    where : str
        Its name in messages.
    read : callable
        Returns it as linear light.
    """

    name: str
    stem: str
    where: str
    read: Callable[[CameraResponse | None], LinearImage]


class Inputs:
    """Images and recordings named on the command line. A context manager.

    Parameters
    ----------
    paths : sequence of Path
        Images and recordings.
    frames : str
        Frames of the recordings, as "a:b". Empty for all.

    Raises
    ------
    InputError
        If a recording cannot be read, the range of frames is invalid or empty, or two inputs would
        have results of the same name.
    """

    def __init__(self, paths: Sequence[Path], frames: str = "") -> None:
        self._open = ExitStack()
        self.recordings: list[Recording] = []
        self.items: list[Input] = []
        try:
            for path in paths:
                if is_recording(path):
                    self._add_recording(path, frames)
                else:
                    read = partial(_read_file, path)
                    self.items.append(Input(path.name, path.stem, str(path), read))
            if frames and not self.recordings:
                raise InputError(
                    tr("None of the inputs is a recording"),
                    where="--frames",
                    advice=Remedy.REMOVE_OPTION,
                )
            self._refuse_twins()
        except BaseException:
            self._open.close()
            raise

    def __enter__(self) -> Inputs:
        """Return itself."""
        return self

    def __exit__(self, *details: object) -> None:
        """Close the recordings."""
        self._open.close()

    def __iter__(self) -> Iterator[Input]:
        """Return the inputs one by one, with a progress bar."""
        return iter(tqdm(self.items, file=sys.stderr, unit=tr("image")))

    def require_match(self, calibration: Calibration) -> None:
        """Refuse recordings of another sensor or image size, and report missing information."""
        for recording in self.recordings:
            require_match(recording, calibration)
            for note in recording_notes(recording):
                say(f"{recording.path}: {note}", file=sys.stderr)

    def _add_recording(self, path: Path, frames: str) -> None:
        recording = self._open.enter_context(Recording.open(path))
        self.recordings.append(recording)
        for index in frame_range(frames, len(recording), where=str(path)):
            stem = f"{path.stem}_{index:06d}"
            where = tr("{path}, frame {n}").format(path=path, n=index)
            read = partial(_read_frame, recording, index, stem)
            self.items.append(Input(f"{stem}{path.suffix}", stem, where, read))

    def _refuse_twins(self) -> None:
        # Some file systems ignore case.
        names = Counter(item.stem.casefold() for item in self.items)
        twins = [item.stem for item in self.items if names[item.stem.casefold()] > 1]
        if twins:
            raise InputError(
                tr("Two images have the name {name}").format(name=twins[0]),
                where=tr("IMAGE"),
                advice=Remedy.SEPARATE_FOLDERS,
            )


def frame_range(text: str, count: int, *, where: str) -> range:
    """Return the frames of a recording that :func:`frame_slice` selects.

    Raises
    ------
    InputError
        If there are none.
    """
    if not count:
        raise InputError(
            tr("The recording contains no frames"), where=where, advice=Remedy.CHOOSE_FILE
        )
    selected = range(count)[frame_slice(text)]
    if not selected:
        raise InputError(
            tr("{text} selects none of the {count} frames, which are 0:{count}").format(
                text=text, count=count
            ),
            where="--frames",
            advice=Remedy.CORRECT_VALUE,
        )
    return selected


def frame_slice(text: str) -> slice:
    """Return the frames of "a:b:n": every n-th from a, counted from 0, up to but not including b.

    Raises
    ------
    InputError
        If it is not such a text.
    """
    match = re.fullmatch(r"(\d*)(:?)(\d*)(?::([1-9]\d*))?", text)
    if match is None:
        raise InputError(
            tr("{text} is not a range of frames such as 0:1000 or 0:1000:10").format(text=text),
            where="--frames",
            advice=Remedy.CORRECT_VALUE,
        )
    first, colon, end, step = match.groups()
    last = int(end) if end else int(first) + 1 if first and not colon else None
    return slice(int(first or 0), last, int(step or 1))


def _read_file(path: Path, response: CameraResponse | None) -> LinearImage:
    image = read_image(path, response=response)
    require_colour(image, where=str(path))
    return image


def _read_frame(
    recording: Recording, index: int, name: str, response: CameraResponse | None
) -> LinearImage:
    return linear_image(recording.frame(index).rgb, name, response=response)
