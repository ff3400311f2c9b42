"""The frames of a recording as surfaces for a movie, made in the background."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from app.live.frame_results import Maker, Wanted
from app.view3d.surface import Surface
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.recording.reader import Recording


def play_surfaces(
    path: Path,
    reconstructor: Reconstructor,
    wanted: Wanted,
    put: Callable[[Surface | None], bool],
    progress: Callable[[float], None],
) -> None:
    """Make the surface of every frame of a recording and pass it on.

    Parameters
    ----------
    path : Path
        The recording.
    reconstructor : Reconstructor
        No other thread may use it at the same time.
    wanted : Wanted
        How the surface is coloured.
    put : callable
        Gets each surface, and None at the end in every case. Returns False if the surfaces are no
        longer needed.
    progress : callable
        Called with the progress (0 to 1). An exception from it stops the work.

    Raises
    ------
    InputError
        If the recording or a frame cannot be used.
    """
    maker = Maker(reconstructor)
    maker.wanted = Wanted(surface=True, display=wanted.display, reference=wanted.reference)
    try:
        recording = Recording.open(path)
        try:
            for index in range(len(recording)):
                progress(index / len(recording))
                surface = maker(recording.frame(index)).surface
                if surface is not None and not put(surface):
                    return
        finally:
            recording.close()
    finally:
        put(None)
