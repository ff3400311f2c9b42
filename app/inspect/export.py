"""Height maps into files: the frame that is shown, or a range of a recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from gelpolight_core.export.heightmap_files import FORMATS, write_heightmap
from gelpolight_core.reconstruction.heightmap import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.translation import tr


@dataclass(frozen=True, slots=True)
class ExportChoice:
    """What a person chose.

    Attributes
    ----------
    folder : Path
        Where the files go.
    formats : tuple of str
        Out of FORMATS.
    stride : int
        The meshes take every so many-th row and column.
    frames : (first, last) or None
        Numbers of frames of the recording, from 0; None: the frame that is shown.
    """

    folder: Path
    formats: tuple[str, ...]
    stride: int = 1
    frames: tuple[int, int] | None = None


def format_words() -> dict[str, str]:
    """Return what each format is good for."""
    words = {
        "npz": tr("npz: everything, for NumPy"),
        "tif": tr("tif: depth, 32 bit float"),
        "png": tr("png: depth, 16 bit with its scale"),
        "gsf": tr("gsf: depth, for Gwyddion"),
        "vtp": tr("vtp: mesh, for ParaView"),
        "ply": tr("ply: mesh with normals"),
        "stl": tr("stl: bare mesh, to print"),
    }
    return {name: words.get(name, name) for name in FORMATS}


def export_frame(heightmap: HeightMap, choice: ExportChoice, name: str) -> list[Path]:
    """Write the height map of one frame."""
    named = replace(heightmap, source=name)
    return write_heightmap(named, choice.folder, formats=choice.formats, stride=choice.stride)


def export_recording(
    path: Path,
    reconstructor: Reconstructor,
    choice: ExportChoice,
    tell: Callable[[float], None],
) -> list[Path]:
    """Reconstruct frames of a recording one after the other and write them.

    Parameters
    ----------
    path : Path
        The recording.
    reconstructor : Reconstructor
        No other thread may use it meanwhile.
    choice : ExportChoice
        With the frames.
    tell : callable
        Told the share done; what it raises stops the work between two frames.

    Raises
    ------
    InputError
        If the recording, a frame or a file cannot be used.
    """
    from gelpolight_core.recording.reader import Recording

    assert choice.frames is not None
    written: list[Path] = []
    recording = Recording.open(path)
    try:
        indices: Sequence[int] = range(choice.frames[0], choice.frames[1] + 1)
        for done, index in enumerate(indices):
            tell(done / len(indices))
            frame = recording.frame(index)
            heightmap = reconstructor.depth(frame.rgb, name=f"{path.stem}-{index:05d}.png")
            written += write_heightmap(
                heightmap, choice.folder, formats=choice.formats, stride=choice.stride
            )
    finally:
        recording.close()
    return written
