"""Which sources can be chosen."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

from app.sources.bench import Bench
from app.sources.folder import FolderSource
from app.sources.source import Source, SourceInfo
from gelpolight_core.translation import tr

Finder = Callable[[], Iterable[SourceInfo]]
"""Looks for sources of one kind, such as the cameras that are plugged in now."""


def list_sources(finders: Sequence[Finder]) -> tuple[SourceInfo, ...]:
    """Return what the finders find now, in their order."""
    return tuple(info for find in finders for info in find())


def virtual_sensor(bench: Bench) -> Finder:
    """Return the finder of the virtual sensor on a bench."""
    camera = bench.design.camera

    def make() -> Source:
        from app.sources.virtual import VirtualSource  # heavy

        return VirtualSource(bench)

    info = SourceInfo(
        "virtual",
        tr("Virtual sensor {serial}").format(serial=bench.design.serial),
        tr("{w} x {h} pixels, rendered").format(w=camera.width_px, h=camera.height_px),
        make,
    )
    return lambda: (info,)


def picture_folders(folders: Sequence[Path]) -> Finder:
    """Return the finder of folders of pictures; a folder that is gone is left out."""

    def find() -> Iterable[SourceInfo]:
        for folder in folders:
            if folder.is_dir():
                detail = str(folder.parent)
                make = partial(FolderSource, folder)
                yield SourceInfo("folder", folder.name, detail, make, folder)

    return find


def recordings(files: Sequence[Path]) -> Finder:
    """Return the finder of recordings; a file that is gone is left out."""

    def find() -> Iterable[SourceInfo]:
        for file in files:
            if file.is_file():
                detail = str(file.parent)
                yield SourceInfo("recording", file.stem, detail, partial(_play, file), file)

    return find


def _play(file: Path) -> Source:
    from app.sources.recording import RecordingSource  # heavy

    return RecordingSource(file)
