"""Describes the sources that can be selected."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from app.sources.bench import Bench
from app.sources.folder import FolderSource
from app.sources.source import Source, SourceInfo
from gelpolight_core.translation import tr


def virtual_sensor(bench: Bench) -> SourceInfo:
    """Return the virtual sensor on a bench."""
    camera = bench.design.camera

    def make() -> Source:
        from app.sources.virtual import VirtualSource  # slow to import

        return VirtualSource(bench)

    return SourceInfo(
        "virtual",
        tr("Virtual sensor {serial}").format(serial=bench.design.serial),
        tr("{w} x {h} pixels, rendered").format(w=camera.width_px, h=camera.height_px),
        make,
    )


def image_folder(folder: Path) -> SourceInfo:
    """Return a folder of images."""
    make = partial(FolderSource, folder)
    return SourceInfo("folder", folder.name, str(folder.parent), make, folder)


def recording(file: Path) -> SourceInfo:
    """Return a recording."""

    def make() -> Source:
        from app.sources.recording import RecordingSource  # slow to import

        return RecordingSource(file)

    return SourceInfo("recording", file.stem, str(file.parent), make, file)
