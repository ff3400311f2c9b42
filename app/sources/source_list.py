"""Describes the sources that can be selected."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from .folder import FolderSource
from .source import Source, SourceInfo
from .virtual_bench import VirtualBench


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
