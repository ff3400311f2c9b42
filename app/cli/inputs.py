"""Inputs of the reconstructing commands: images and frames of recordings."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.image.linear_image import LinearImage, linear_image
from gelpolight_core.image.response import CameraResponse
from gelpolight_core.output.recording.recording_reader import Recording, is_recording
from gelpolight_core.session.session_images import read_colours


@dataclass(frozen=True, slots=True)
class ImageInput:
    """One input image.

    Attributes
    ----------
    name : str
        Name of the image in the result. Without extension, the name of the result's files.
    where : str
        Name of the image in messages.
    read : callable
        Returns it as linear light.
    """

    name: str
    where: str
    read: Callable[[CameraResponse | None], LinearImage]

    @property
    def stem(self) -> str:
        """The name without its extension."""
        return Path(self.name).stem


def open_inputs(
    paths: Sequence[Path], frames: str, opened: ExitStack
) -> tuple[list[ImageInput], list[Recording]]:
    """Return the images of files and recordings, and the recordings, which `opened` closes.

    Parameters
    ----------
    paths : sequence of Path
        Images and recordings.
    frames : str
        Frames of the recordings, as "a:b:n". Empty for all.
    opened : ExitStack
        Closes the recordings.

    Raises
    ------
    InputError
        If a recording cannot be read, the range of frames is invalid or empty, or two inputs would
        have results of the same name.
    """
    inputs: list[ImageInput] = []
    recordings: list[Recording] = []
    for path in paths:
        if not is_recording(path):
            inputs.append(ImageInput(path.name, str(path), partial(read_colours, path)))
            continue
        recording = opened.enter_context(Recording.open(path))
        recordings.append(recording)
        for index in frame_range(frames, len(recording), where=str(path)):
            name = f"{path.stem}_{index:06d}{path.suffix}"
            where = f"{path}, frame {index}"
            inputs.append(ImageInput(name, where, partial(_read_frame, recording, index)))
    if frames and not recordings:
        raise InputError("None of the inputs is a recording", "--frames", Remedy.REMOVE_OPTION)
    # Some file systems ignore case.
    names = Counter(item.stem.casefold() for item in inputs)
    duplicates = [item.stem for item in inputs if names[item.stem.casefold()] > 1]
    if duplicates:
        raise InputError(
            f"Two images have the name {duplicates[0]}", "IMAGE", Remedy.SEPARATE_FOLDERS
        )
    return inputs, recordings


def frame_range(text: str, count: int, *, where: str) -> range:
    """Return the frames of a recording that :func:`frame_slice` selects.

    Raises
    ------
    InputError
        If there are none.
    """
    if not count:
        raise InputError("The recording contains no frames", where, Remedy.CHOOSE_FILE)
    selected = range(count)[frame_slice(text)]
    if not selected:
        raise InputError(
            f"{text} selects none of the {count} frames, which are 0:{count}",
            "--frames",
            Remedy.CORRECT_VALUE,
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
            f"{text} is not a range of frames such as 0:1000 or 0:1000:10",
            "--frames",
            Remedy.CORRECT_VALUE,
        )
    first, colon, end, step = match.groups()
    last = int(end) if end else int(first) + 1 if first and not colon else None
    return slice(int(first or 0), last, int(step or 1))


def _read_frame(recording: Recording, index: int, response: CameraResponse | None) -> LinearImage:
    return linear_image(recording.frame(index).rgb, str(index), response=response)
