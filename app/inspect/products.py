"""From a frame to what is shown of it, and nothing more; runs in the processing thread."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from app.inspect import shading
from app.inspect.cuts import Cut, Section, cut
from app.inspect.look import LEAST_RANGE_MM, Look, colour_table
from app.inspect.surface import LIVE_NODES, Surface, surface_of
from app.live.zebra import eight_bits
from app.sources.source import Frame
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.reconstruction.heightmap import Flag, HeightMap
from gelpolight_core.reconstruction.misfit import Misfit, solve_misfit
from gelpolight_core.reconstruction.reconstructor import Reconstructor

LIVE_PX = 560
CAMERA_PX = 760
STILL_PX = 2000
MISFIT_NODES = 128, 400
"""A side, of a moving and of a standing picture."""
LEAST_MISFIT = 0.02
SURROUND = (21, 23, 26)
STEEPNESS = colour_table("magma"), 0.0, 60.0
"""Colours of the slope, and its degrees at their ends."""

QUALITY_COLOURS = {
    Flag.INVALID: (225, 225, 225),
    Flag.NOT_OBSERVABLE: (255, 89, 94),
    Flag.DARK: (84, 125, 255),
    Flag.SATURATED: (255, 0, 255),
    Flag.EXTRAPOLATED: (255, 202, 58),
}
"""Colour of each flag, the weightiest first."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """What is looked at; what is not is not computed.

    Attributes
    ----------
    surface, height, camera : bool
        The views that are shown.
    normals : str
        What the view of normals shows: ``normals``, ``slope``, or empty where it is hidden.
    quality : str
        What the quality view shows: ``flags``, ``uncertainty``, ``misfit``, or empty where it is
        hidden.
    section : Section or None
        The line that is measured along.
    region : Rectangle or None
        The rectangle whose roughness is measured.
    look : Look
        How.
    still : bool
        Whether the picture stands: with all detail then, and with the uncertainty if wanted.
    """

    surface: bool = False
    height: bool = False
    normals: str = ""
    camera: bool = False
    quality: str = ""
    section: Section | None = None
    region: Rectangle | None = None
    look: Look = field(default_factory=Look)
    still: bool = False

    @property
    def needs_depth(self) -> bool:
        """Whether the frame must be reconstructed."""
        views = self.surface or self.height or bool(self.normals) or bool(self.quality)
        return views or self.section is not None or self.region is not None

    @property
    def needs_normals(self) -> bool:
        """Whether the reconstruction must say how each place is tilted."""
        return bool(self.normals) or self.quality == "misfit"


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """What is shown of a frame; None where it was not wanted.

    Attributes
    ----------
    frame : Frame
        The camera's.
    heightmap : HeightMap or None
        As reconstructed.
    range_mm : (low, high)
        Depths at the ends of the colours.
    camera : (rows, columns, 3) uint8 or None
        The camera's picture, made smaller while it moves.
    height, normals, quality : (rows, columns, 3) uint8 or None
        Pictures over the extent of the grid.
    quality_top : float
        Value at the upper end of the quality picture's colours: mm, or a share.
    misfit : Misfit or None
        How well the depth explains the picture.
    surface : Surface or None
        For the 3D view.
    cut : Cut or None
        What was measured along the line.
    depth_ms, total_ms : float
        Time of the reconstruction, and of everything.
    """

    frame: Frame
    heightmap: HeightMap | None = None
    range_mm: tuple[float, float] = (0.0, 1.0)
    camera: NDArray[np.uint8] | None = None
    height: NDArray[np.uint8] | None = None
    normals: NDArray[np.uint8] | None = None
    quality: NDArray[np.uint8] | None = None
    quality_top: float = 0.0
    misfit: Misfit | None = None
    surface: Surface | None = None
    cut: Cut | None = None
    depth_ms: float = 0.0
    total_ms: float = 0.0


class Maker:
    """Makes what is shown; a function of a frame for the processing thread.

    Parameters
    ----------
    live : Reconstructor or None
        For moving pictures; None: only the camera's picture.
    best : Reconstructor or None
        For a standing one; by default the same.
    """

    def __init__(self, live: Reconstructor | None, best: Reconstructor | None = None) -> None:
        self.live, self.best = live, best or live
        self.wanted = Wanted()
        self._last: tuple[Frame, tuple[Reconstructor, bool], HeightMap, float] | None = None

    def __call__(self, frame: Frame) -> Shown:
        """Make what is wanted of a frame."""
        wanted = self.wanted
        began = time.perf_counter()
        camera = camera_picture(frame, wanted) if wanted.camera else None
        if self.live is None or not wanted.needs_depth:
            return Shown(frame, camera=camera)
        heightmap, depth_ms = self._heightmap(frame, wanted)
        misfit = self._misfit(frame, heightmap, wanted) if wanted.quality == "misfit" else None
        shown = _Pictures(heightmap, wanted, misfit)
        surface = shown.surface() if wanted.surface else None
        quality, top = shown.quality() if wanted.quality else (None, 0.0)
        return Shown(
            frame=frame,
            heightmap=heightmap,
            range_mm=shown.range_mm,
            camera=camera,
            height=shown.height() if wanted.height else None,
            normals=shown.normals() if wanted.normals else None,
            quality=quality,
            quality_top=top,
            misfit=misfit,
            surface=surface,
            cut=None if wanted.section is None else cut(heightmap, wanted.section, wanted.region),
            depth_ms=depth_ms,
            total_ms=1e3 * (time.perf_counter() - began),
        )

    def _heightmap(self, frame: Frame, wanted: Wanted) -> tuple[HeightMap, float]:
        """Return the frame's height map; that of a standing picture is kept."""
        reconstructor = self.best if wanted.still else self.live
        assert reconstructor is not None
        uncertainty = wanted.still and wanted.quality == "uncertainty"
        if self._last is not None:
            same, made, heightmap, depth_ms = self._last
            has = (heightmap.normals is not None, heightmap.depth_sd_mm is not None)
            enough = has[0] >= wanted.needs_normals and (has[1] or made[1] >= uncertainty)
            if same is frame and made[0] is reconstructor and enough:
                return heightmap, depth_ms
        began = time.perf_counter()
        heightmap = reconstructor.depth(
            frame.rgb, normals=wanted.needs_normals, uncertainty=uncertainty
        )
        depth_ms = 1e3 * (time.perf_counter() - began)
        self._last = frame, (reconstructor, uncertainty), heightmap, depth_ms
        return heightmap, depth_ms

    def _misfit(self, frame: Frame, heightmap: HeightMap, wanted: Wanted) -> Misfit:
        reconstructor = self.best if wanted.still else self.live
        assert reconstructor is not None
        nodes = MISFIT_NODES[wanted.still]
        return solve_misfit(reconstructor, frame.rgb, heightmap, largest=nodes)


def camera_picture(frame: Frame, wanted: Wanted) -> NDArray[np.uint8]:
    """Return the camera's picture for the screen."""
    shown = frame.rgb if wanted.still else shading.fitted(frame.rgb, CAMERA_PX)
    return eight_bits(shown)


class _Pictures:
    """The pictures of one height map, in the size that they are shown in."""

    def __init__(self, heightmap: HeightMap, wanted: Wanted, misfit: Misfit | None = None) -> None:
        self._map, self._wanted, self._look = heightmap, wanted, wanted.look
        self._misfit = misfit
        self._px = STILL_PX if wanted.still else LIVE_PX
        self._depth = shading.fitted(heightmap.depth_mm, self._px)
        rows, columns = self._depth.shape
        self._pitch_mm = heightmap.pitch_mm * heightmap.depth_mm.shape[1] / columns
        self._flags = self._thinned(heightmap.flags)
        self._outside = cv2.bitwise_and(
            self._flags, np.full((rows, columns), Flag.OUTSIDE.value, np.uint8)
        )
        self.range_mm = self._look.range_mm or shading.automatic_range(
            heightmap.depth_mm, LEAST_RANGE_MM
        )
        self._flat: NDArray[np.uint8] | None = None
        self._lit: NDArray[np.uint8] | None = None

    def _thinned(self, values: NDArray[Any]) -> NDArray[Any]:
        rows, columns = self._depth.shape
        return np.asarray(cv2.resize(values, (columns, rows), interpolation=cv2.INTER_NEAREST))

    def _coloured(self) -> NDArray[np.uint8]:
        if self._flat is None:
            table = colour_table(self._look.colours)
            self._flat = shading.coloured(self._depth, table, *self.range_mm)
        return self._flat

    def _shaded(self) -> NDArray[np.uint8]:
        if self._lit is None:
            look = self._look
            self._lit = shading.shaded(
                self._depth,
                self._pitch_mm,
                colour_table(look.colours),
                self.range_mm,
                look.light,
                exaggeration=look.exaggeration,
                contour_mm=look.contour_mm,
            )
        return self._lit

    def height(self) -> NDArray[np.uint8]:
        """Return the height map."""
        if self._look.relief:
            rgb = self._shaded().copy()
        elif self._look.contour_mm > 0.0:
            rgb = shading.with_contours(self._coloured(), self._depth, self._look.contour_mm)
        else:
            rgb = self._coloured().copy()
        return shading.outside_filled(rgb, self._outside, SURROUND)

    def normals(self) -> NDArray[np.uint8]:
        """Return the normals, or how steep they are, as colours."""
        assert self._map.normals is not None
        normals = shading.fitted(self._map.normals, self._px)
        if self._wanted.normals == "slope":
            rgb = shading.coloured(shading.steepness_deg(normals), *STEEPNESS)
        else:
            rgb = shading.normal_colours(normals)
        return shading.outside_filled(rgb, self._outside, SURROUND)

    def quality(self) -> tuple[NDArray[np.uint8] | None, float]:
        """Return the flags over the dimmed relief, or a figure in colours, and its upper end."""
        sd = self._map.depth_sd_mm
        if self._misfit is not None:
            values = self._misfit.values
            known = values[np.isfinite(values)]
            top = max(float(np.percentile(known, 99.0)) if known.size else 0.0, LEAST_MISFIT)
            rows, columns = self._depth.shape
            shown = cv2.resize(np.nan_to_num(values), (columns, rows))
            rgb = shading.coloured(np.asarray(shown), colour_table("inferno"), 0.0, top)
            return shading.outside_filled(rgb, self._outside, SURROUND), top
        if self._wanted.quality == "uncertainty":
            if sd is None:
                return None, 0.0
            shown = shading.fitted(sd, self._px)
            inside = shown[self._outside == 0]
            top = float(np.percentile(inside, 99.0)) if inside.size else 1.0
            rgb = shading.coloured(shown, colour_table("inferno"), 0.0, top)
            return shading.outside_filled(rgb, self._outside, SURROUND), top
        grey = cv2.cvtColor(self._shaded(), cv2.COLOR_RGB2GRAY)
        dim = cv2.convertScaleAbs(cv2.merge([grey] * 3), alpha=0.6, beta=25)
        rgb = shading.flag_colours(np.asarray(dim, np.uint8), self._flags, QUALITY_COLOURS)
        return shading.outside_filled(rgb, self._outside, SURROUND), 0.0

    def surface(self) -> Surface:
        """Return the mesh's nodes and their texture."""
        if self._wanted.still:
            return surface_of(self._map, self._shaded())
        return surface_of(self._map, self._shaded(), largest=LIVE_NODES, depth_mm=self._depth)


def warm_up() -> None:
    """Compile what the first picture would wait for."""
    flat, look = np.zeros((8, 8), np.float32), Look()
    shading.shaded(flat, 0.1, colour_table(look.colours), (0.0, 1.0), look.light)
