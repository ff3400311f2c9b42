"""Write height maps to files: the current frame or a range of a recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from app.sources.source import Frame, Source
from gelpolight_core.export.heightmap_files import FORMATS, write_heightmap
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.translation import tr


@dataclass(frozen=True, slots=True)
class ExportChoice:
    """The export settings of the user.

    Attributes
    ----------
    folder : Path
        Destination folder.
    formats : tuple of str
        Some of FORMATS.
    stride : int
        Meshes use every n-th row and column.
    frames : (first, last) or None
        Frame numbers in the recording, from 0. None: the current frame.
    """

    folder: Path
    formats: tuple[str, ...]
    stride: int = 1
    frames: tuple[int, int] | None = None


def format_words() -> dict[str, str]:
    """Return the use of each format."""
    words = {
        "npz": tr("npz: all data, for NumPy"),
        "tif": tr("tif: depth, 32-bit float"),
        "png": tr("png: depth, 16-bit with its scale"),
        "gsf": tr("gsf: depth, for Gwyddion"),
        "csv": tr("csv: depth as a table, for spreadsheets"),
        "xyz": tr("xyz: one point per line, for point cloud programs"),
        "vtp": tr("vtp: mesh, for ParaView"),
        "ply": tr("ply: mesh with normals"),
        "stl": tr("stl: mesh only, for 3D printing"),
        "glb": tr("glb: glTF mesh in metres, for 3D viewers and web pages"),
    }
    return {name: words.get(name, name) for name in FORMATS}


def frame_name(frame: Frame, source: Source | None, *, processed: bool = False) -> str:
    """Return the name of an exported frame: of a recording, the same as in the export of a range.

    Parameters
    ----------
    frame : Frame
        The frame.
    source : Source or None
        Its source.
    processed : bool, optional
        Whether its height map is processed. The name then says so.
    """
    name = f"frame-{frame.number:05d}"
    if frame.index is not None and source is not None:
        name = f"{source.name}-{frame.index:05d}"
    return f"{name}-processed.png" if processed else f"{name}.png"


def export_frame(heightmap: HeightMap, choice: ExportChoice, name: str) -> list[Path]:
    """Write the height map of one frame."""
    named = replace(heightmap, source=name)
    return write_heightmap(named, choice.folder, formats=choice.formats, stride=choice.stride)


def export_recording(
    path: Path,
    reconstructor: Reconstructor,
    choice: ExportChoice,
    progress: Callable[[float], None],
) -> list[Path]:
    """Reconstruct frames of a recording one after the other and write them.

    Parameters
    ----------
    path : Path
        The recording.
    reconstructor : Reconstructor
        No other thread may use it at the same time.
    choice : ExportChoice
        With the frames.
    progress : callable
        Called with the progress (0 to 1). An exception from it stops the work between two frames.

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
            progress(done / len(indices))
            frame = recording.frame(index)
            heightmap = reconstructor.depth(frame.rgb, name=f"{path.stem}-{index:05d}.png")
            written += write_heightmap(
                heightmap, choice.folder, formats=choice.formats, stride=choice.stride
            )
    finally:
        recording.close()
    return written
