"""The sources without a driver of their own: virtual sensor, recordings, folders of images."""

from __future__ import annotations

import math
import threading
import time
from functools import partial
from pathlib import Path

import numpy as np

from gelpolight_core.base.arrays import PixelArray
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.image.image_file import files_in
from gelpolight_core.session.session_images import read_linear_image

from .source import Source, SourceFrame, SourceInfo, SourceSetting, source_closed_error
from .virtual_bench import VirtualBench

RATE_HZ = 10.0
# Decoding takes longer than a frame at 30 Hz; images within this limit are decoded only once.
_CACHE_BYTES = 256 * 2**20


class FolderSource:
    """PNG and TIFF images of a folder, in the order of their names.

    Parameters
    ----------
    folder : Path
        Folder with the images.
    """

    kind = "folder"

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder)
        self.name = self.folder.name
        self._size = (0, 0)
        self._files: tuple[Path, ...] = ()
        self._decoded: dict[int, PixelArray] = {}
        self._closed = threading.Event()
        self._number, self._due_s = 0, math.nan

    def open(self) -> None:
        """List the images and read the first one, whose size all must have."""
        if self._files:
            return
        self._closed.clear()
        self._number, self._due_s = 0, math.nan
        files = files_in(self.folder).images
        if not files:
            raise InputError("there are no images", self.folder, Remedy.CHOOSE_IMAGES)
        self._size = read_linear_image(files[0]).size
        self._files = files

    def frame(self, timeout_s: float) -> SourceFrame | None:
        """Wait for the next image. None: it is not due yet."""
        if not self._files:
            raise source_closed_error(str(self.folder))
        now = time.monotonic()
        due_s = now if math.isnan(self._due_s) else self._due_s
        if due_s > now and self._closed.wait(min(due_s - now, timeout_s)):
            return None
        if due_s > now + timeout_s:
            return None
        rgb = self._image(self._number % len(self._files))
        # A folder waits for its reader, so no frame is ever lost.
        now = time.monotonic()
        self._due_s = max(due_s + 1.0 / RATE_HZ, now)
        self._number += 1
        return SourceFrame(rgb, self._number - 1, now)

    def settings(self) -> tuple[SourceSetting, ...]:
        """Return none."""
        return ()

    def close(self) -> None:
        """Discard the images."""
        self._closed.set()
        self._files = ()
        self._decoded.clear()

    def _image(self, index: int) -> PixelArray:
        if index in self._decoded:
            return self._decoded[index]
        image = read_linear_image(self._files[index])
        if image.size != self._size:
            size, first = ("x".join(map(str, size)) for size in (image.size, self._size))
            message = f"the image has {size} pixels, but the first image of the folder has {first}"
            raise InputError(message, self._files[index], Remedy.SAME_CAMERA)
        full_scale = 2**image.bit_depth - 1
        kind = np.uint8 if image.bit_depth == 8 else np.uint16
        rgb: PixelArray = np.rint(image.rgb * np.float32(full_scale)).astype(kind)
        rgb.flags.writeable = False
        if rgb.nbytes + sum(decoded.nbytes for decoded in self._decoded.values()) <= _CACHE_BYTES:
            self._decoded[index] = rgb
        return rgb


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
