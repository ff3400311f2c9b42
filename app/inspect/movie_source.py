"""The frames of a recording as surfaces for a movie, made in the background."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path

from PySide6.QtCore import QCoreApplication

from app.live.frame_results import Maker, Wanted
from app.view3d.surface import Surface
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.recording.reader import Recording

WAIT_S = 0.02
"""Longest time between two looks at the events of the window: it follows the mouse."""


def recorded_surfaces(
    path: Path, reconstructor: Reconstructor, wanted: Wanted
) -> Iterator[Surface]:
    """Yield the surface of every frame of a recording. Meanwhile the window can be used.

    Parameters
    ----------
    path : Path
        The recording.
    reconstructor : Reconstructor
        No other thread may use it at the same time.
    wanted : Wanted
        How the surface is coloured.

    Raises
    ------
    InputError
        If the recording or a frame cannot be used.
    """
    maker = Maker(reconstructor)
    maker.wanted = Wanted(surface=True, display=wanted.display, reference=wanted.reference)
    recording = Recording.open(path)
    try:
        with ThreadPoolExecutor(1, "movie") as pool:
            for index in range(len(recording)):
                made = pool.submit(lambda frame: maker(frame).surface, recording.frame(index))
                while wait([made], WAIT_S).not_done:
                    QCoreApplication.processEvents()
                surface = made.result()
                if surface is not None:
                    yield surface
    finally:
        recording.close()
