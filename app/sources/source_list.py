"""The sources without a driver of their own: virtual sensor, recordings, folders of images."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from gelpolight_core.base.arrays import PixelArray
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.image.image_file import files_in
from gelpolight_core.session.session_images import read_linear_image

from .player import Playback, Player
from .source import Source, SourceInfo
from .virtual_bench import VirtualBench

RATE_HZ = 10.0
"""Images per second when a folder is played."""


class FolderSource(Player):
    """PNG and TIFF images of a folder, in the order of their names: the first one at first.

    Parameters
    ----------
    folder : Path
        Folder with the images.
    """

    kind = "folder"

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, playing=False)
        self.name = self.path.name
        self._size = (0, 0)
        self._files: tuple[Path, ...] = ()

    def open(self) -> None:
        """List the images and read the first one, whose size all must have."""
        with self._changed:
            if self._times_s.size:
                return
            files = files_in(self.path).images
            if not files:
                raise InputError("there are no images", self.path, Remedy.CHOOSE_IMAGES)
            self._files, self._size = files, read_linear_image(files[0]).size
            self._rewind(np.arange(len(files)) / RATE_HZ)

    def playback(self) -> Playback:
        """Return the state of the player, with the file of the shown image."""
        now = super().playback()
        return replace(now, file=self.image_name(now.position)) if now.count else now

    def image_name(self, index: int) -> str:
        """Return the name of an image's file."""
        return self._files[index].name

    def _read(self, index: int) -> PixelArray:
        image = read_linear_image(self._files[index])
        if image.size != self._size:
            size, first = ("x".join(map(str, size)) for size in (image.size, self._size))
            message = f"the image has {size} pixels, but the first image of the folder has {first}"
            raise InputError(message, self._files[index], Remedy.SAME_CAMERA)
        full_scale = 2**image.bit_depth - 1
        kind = np.uint8 if image.bit_depth == 8 else np.uint16
        rgb: PixelArray = np.rint(image.rgb * np.float32(full_scale)).astype(kind)
        return rgb


def next_image(path: Path) -> Path | None:
    """Return the image file after this one in its folder, or None if it is the last one."""
    images = files_in(path.parent).images
    return next((image for image in images if image > path), None)


def virtual_sensor(bench: VirtualBench) -> SourceInfo:
    """Return the virtual sensor on a bench as a source to select."""
    camera = bench.design.camera

    def make() -> Source:
        from .virtual_source import VirtualSource  # slow to import

        return VirtualSource(bench)

    return SourceInfo(
        "virtual",
        f"Virtual sensor {bench.design.serial}",
        f"{camera.width_px} x {camera.height_px} pixels, rendered",
        make,
    )


def image_folder(folder: Path) -> SourceInfo:
    """Return a folder of images as a source to select."""
    make = partial(FolderSource, folder)
    return SourceInfo("folder", folder.name, str(folder.parent), make, folder)


def recording(file: Path) -> SourceInfo:
    """Return a recording as a source to select."""

    def make() -> Source:
        from .recording import RecordingSource  # slow to import

        return RecordingSource(file)

    return SourceInfo("recording", file.stem, str(file.parent), make, file)
