"""Lists the sources that can be selected."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

from app.sources.bench import Bench
from app.sources.folder import FolderSource
from app.sources.source import Source, SourceInfo
from gelpolight_core.translation import tr

Finder = Callable[[], Iterable[SourceInfo]]
"""Finds sources of one kind, such as the connected cameras."""


def virtual_sensor(bench: Bench) -> Finder:
    """Return the finder of the virtual sensor on a bench."""
    camera = bench.design.camera

    def make() -> Source:
        from app.sources.virtual import VirtualSource  # slow to import

        return VirtualSource(bench)

    info = SourceInfo(
        "virtual",
        tr("Virtual sensor {serial}").format(serial=bench.design.serial),
        tr("{w} x {h} pixels, rendered").format(w=camera.width_px, h=camera.height_px),
        make,
    )
    return lambda: (info,)


def image_folders(folders: Sequence[Path]) -> Finder:
    """Return the finder of image folders; deleted folders are skipped."""

    def find() -> Iterable[SourceInfo]:
        for folder in folders:
            if folder.is_dir():
                detail = str(folder.parent)
                make = partial(FolderSource, folder)
                yield SourceInfo("folder", folder.name, detail, make, folder)

    return find


def recordings(files: Sequence[Path]) -> Finder:
    """Return the finder of recordings; deleted files are skipped."""

    def find() -> Iterable[SourceInfo]:
        for file in files:
            if file.is_file():
                detail = str(file.parent)
                yield SourceInfo("recording", file.stem, detail, partial(_play, file), file)

    return find


def _play(file: Path) -> Source:
    from app.sources.recording import RecordingSource  # slow to import

    return RecordingSource(file)
