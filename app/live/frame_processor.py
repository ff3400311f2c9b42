"""Computes from a frame only what is shown. Runs in the processing thread."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from app.program.display import DisplaySettings
from app.sources.source import SourceFrame
from app.views.map import shading
from app.views.map.colour_range import ColourRange, RangeLimitSmoother
from app.views.map.colour_tables import colour_table
from app.views.map.display_processing import MapProcessor, ProcessedMap, ProcessingSteps
from app.views.map.quantities import (
    ReferenceMap,
    depth_scale,
    difference_scale,
    flag_scale,
    slope_scale,
    uncertainty_scale,
)
from app.views.map.sections import SectionResult, SectionSettings, measure_sections
from app.views.surface.display_surface import LIVE_NODES, ColourScale, DisplaySurface, surface_of
from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.finding import Finding
from gelpolight_core.health.frame_health import FrameHealth
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.map_processing import subtract_map
from gelpolight_core.reconstruction.height_map import Flag, HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor

from .image_checks import eight_bits

MISFIT_NODES = 128, 400
"""Longest side of a live and of a frozen image, in pixels."""
LEAST_MISFIT = 0.02


@dataclass(frozen=True, slots=True)
class FrameRequest:
    """Results that the visible views need of a frame. Nothing else is computed.

    Attributes
    ----------
    surface, height, camera : bool
        The visible views.
    normals : str
        Content of the normals view: ``normals``, ``slope``, or empty if it is hidden.
    quality : str
        Content of the quality view: ``flags``, ``uncertainty``, ``misfit``, or empty if it is
        hidden.
    section : SectionSettings or None
        The line to measure along.
    region : Rectangle or None
        The rectangle whose roughness is measured.
    display : DisplaySettings
        The display settings.
    reference : ReferenceMap or None
        The reference of the difference.
    processing : ProcessingSteps
        Processing of the height map of a frozen image.
    stream : bool
        Whether depth and normals are sent to other programs.
    still : bool
        Whether the image is frozen. It is then processed at full detail, with the uncertainty if
        needed.
    """

    surface: bool = False
    height: bool = False
    normals: str = ""
    camera: bool = False
    quality: str = ""
    section: SectionSettings | None = None
    region: Rectangle | None = None
    display: DisplaySettings = field(default_factory=DisplaySettings)
    reference: ReferenceMap | None = None
    processing: ProcessingSteps = field(default_factory=ProcessingSteps)
    stream: bool = False
    still: bool = False

    @property
    def needs_uncertainty(self) -> bool:
        """Whether a view shows the uncertainty of a frozen image."""
        in_3d = self.surface and self.display.colour_by == "uncertainty"
        return self.still and (in_3d or self.quality == "uncertainty")

    @property
    def needs_depth(self) -> bool:
        """Whether the frame must be reconstructed."""
        views = self.surface or self.height or bool(self.normals) or bool(self.quality)
        return views or self.stream or self.section is not None or self.region is not None

    @property
    def needs_normals(self) -> bool:
        """Whether the reconstruction must include the normals."""
        return bool(self.normals) or self.stream


@dataclass(frozen=True, slots=True, eq=False)
class FrameResult:
    """The results of a frame. None for those that were not requested.

    Attributes
    ----------
    frame : SourceFrame
        The frame of the camera.
    heightmap : HeightMap or None
        As shown and measured: with the steps of `processed`, else as reconstructed.
    raw : HeightMap or None
        As reconstructed. The normals and the quality are always those of this one.
    processed : tuple of str
        Sentences that say what was done to the height map. Empty: nothing.
    refused : str
        Why the height map could not be processed.
    range_mm : (low, high)
        Depths at the ends of the colours.
    colours : str
        Colour map of the height map.
    camera : (rows, columns, 3) uint8 or None
        The camera image, reduced in size while live.
    height, normals, quality : (rows, columns, 3) uint8 or None
        Images over the extent of the grid.
    quality_top : float
        Value at the upper end of the quality image's colours: mm, or a share.
    without_uncertainty : bool
        Whether the uncertainty was requested and the model states none.
    misfit : (rows, columns) float32 or None
        How far the image is from that of the depth, as a share of the flat membrane's brightness.
    surface : DisplaySurface or None
        For the 3D view.
    cut : SectionResult or None
        Measurements along the line.
    depth_ms, total_ms : float
        Time of the reconstruction, and of all steps.
    health : FrameHealth or None
        Faults of the frame, if it was reconstructed. There is no depth if they make it meaningless.
    """

    frame: SourceFrame
    heightmap: HeightMap | None = None
    raw: HeightMap | None = None
    processed: tuple[str, ...] = ()
    refused: str = ""
    range_mm: tuple[float, float] = (0.0, 1.0)
    colours: str = DisplaySettings().colours
    camera: NDArray[np.uint8] | None = None
    height: NDArray[np.uint8] | None = None
    normals: NDArray[np.uint8] | None = None
    quality: NDArray[np.uint8] | None = None
    quality_top: float = 0.0
    without_uncertainty: bool = False
    misfit: Float32Array | None = None
    surface: DisplaySurface | None = None
    cut: SectionResult | None = None
    depth_ms: float = 0.0
    total_ms: float = 0.0
    health: FrameHealth | None = None

    @property
    def fault(self) -> Finding | None:
        """The fault that makes the depth meaningless, or None."""
        return None if self.health is None else self.health.meaningless


class FrameProcessor:
    """Computes what is shown. The processing thread calls it with each frame.

    Parameters
    ----------
    live : Reconstructor or None
        For live images. None: only the camera image.
    best : Reconstructor or None
        For frozen images. By default the same.

    Attributes
    ----------
    colour_range : ColourRange
        The automatic range of the colours. Another source gets another one.
    """

    def __init__(self, live: Reconstructor | None, best: Reconstructor | None = None) -> None:
        self.live, self.best = live, best or live
        self.wanted = FrameRequest()
        self.colour_range = ColourRange()
        self._misfit_top = RangeLimitSmoother()
        self._last: tuple[SourceFrame, tuple[Reconstructor, bool], HeightMap, float] | None = None
        self._process = MapProcessor()

    def __call__(self, frame: SourceFrame) -> FrameResult:
        """Compute the requested results of a frame."""
        request, section = self.wanted, self.wanted.section
        began = time.perf_counter()
        camera = camera_image(frame, request) if request.camera else None
        if self.live is None or not request.needs_depth:
            return FrameResult(frame, camera=camera)
        raw, depth_ms = self._heightmap(frame, request)
        if raw.health is not None and raw.health.meaningless is not None:
            return FrameResult(frame, camera=camera, health=raw.health)
        processed = self._process(raw, request.processing) if request.still else ProcessedMap(raw)
        heightmap = processed.heightmap
        misfit = self._misfit(frame, raw, request)
        misfit_top = 0.0 if misfit is None else self._steady_top(misfit, frame)
        # A processed map and a paused one have a range of their own, which nothing continues.
        colours = ColourRange() if processed.steps or frame.paused else self.colour_range
        automatic = colours.update(heightmap.depth_mm, frame.time_s)
        range_mm = request.display.range_mm or automatic
        images = _MapImages(processed, raw, request, range_mm, misfit, misfit_top)
        surface = images.surface() if request.surface else None
        quality, top = images.quality() if request.quality else (None, 0.0)
        return FrameResult(
            frame=frame,
            heightmap=heightmap,
            raw=raw,
            processed=processed.steps,
            refused=processed.refused,
            range_mm=images.range_mm,
            colours=request.display.colours,
            camera=camera,
            height=images.height() if request.height else None,
            normals=images.normals() if request.normals else None,
            quality=quality,
            quality_top=top,
            without_uncertainty=request.needs_uncertainty and raw.depth_sd_mm is None,
            misfit=misfit,
            surface=surface,
            cut=None if section is None else measure_sections(heightmap, section, request.region),
            depth_ms=depth_ms,
            total_ms=1e3 * (time.perf_counter() - began),
            health=raw.health,
        )

    def _heightmap(self, frame: SourceFrame, request: FrameRequest) -> tuple[HeightMap, float]:
        """Return the frame's height map. That of a frozen image is kept."""
        reconstructor = self.best if request.still else self.live
        assert reconstructor is not None
        uncertainty = request.needs_uncertainty
        if self._last is not None:
            last_frame, (last_reconstructor, had_uncertainty), heightmap, depth_ms = self._last
            is_same = last_frame is frame and last_reconstructor is reconstructor
            has_normals = heightmap.normals is not None or not request.needs_normals
            # A model without uncertainty is asked for it only once.
            has_sd = heightmap.depth_sd_mm is not None or had_uncertainty or not uncertainty
            if is_same and has_normals and has_sd:
                return heightmap, depth_ms
        began = time.perf_counter()
        heightmap = reconstructor.depth(
            frame.rgb, normals=request.needs_normals, uncertainty=uncertainty
        )
        depth_ms = 1e3 * (time.perf_counter() - began)
        self._last = frame, (reconstructor, uncertainty), heightmap, depth_ms
        return heightmap, depth_ms

    def _misfit(
        self, frame: SourceFrame, heightmap: HeightMap, request: FrameRequest
    ) -> Float32Array | None:
        if request.quality != "misfit":
            return None
        reconstructor = self.best if request.still else self.live
        assert reconstructor is not None
        nodes = MISFIT_NODES[request.still]
        return reconstructor.misfit(frame.rgb, heightmap, largest=nodes)

    def _steady_top(self, misfit: Float32Array, frame: SourceFrame) -> float:
        values = misfit[np.isfinite(misfit)]
        top = float(np.percentile(values, 99.0)) if values.size else 0.0
        return self._misfit_top.update(max(top, LEAST_MISFIT), frame.time_s)


def camera_image(frame: SourceFrame, request: FrameRequest) -> NDArray[np.uint8]:
    """Return the camera image for the screen."""
    rgb = frame.rgb if request.still else shading.shrink_to(frame.rgb, 760)
    return eight_bits(rgb)


class _MapImages:
    """The images of one height map, in the size in which they are shown."""

    def __init__(
        self,
        processed: ProcessedMap,
        raw: HeightMap,
        request: FrameRequest,
        range_mm: tuple[float, float],
        misfit: Float32Array | None,
        misfit_top: float,
    ) -> None:
        heightmap, self._raw, self._steps = processed.heightmap, raw, processed.steps
        self._map, self._wanted, self._display = heightmap, request, request.display
        self._misfit, self._misfit_top = misfit, misfit_top
        self._px = 2000 if request.still else 560
        self._depth = shading.shrink_to(heightmap.depth_mm, self._px)
        rows, columns = self._depth.shape
        self._pitch_mm = heightmap.pitch_mm * heightmap.depth_mm.shape[1] / columns
        flags = cv2.resize(heightmap.flags, (columns, rows), interpolation=cv2.INTER_NEAREST)
        self._flags = np.asarray(flags, np.uint8)
        outside = np.full((rows, columns), Flag.OUTSIDE.value, np.uint8)
        self._outside = np.asarray(cv2.bitwise_and(self._flags, outside), np.uint8)
        self.range_mm = range_mm

    @cached_property
    def _flat(self) -> NDArray[np.uint8]:
        return shading.flat_image(self._depth, self._pitch_mm, self._display, self.range_mm)

    @cached_property
    def _shaded(self) -> NDArray[np.uint8]:
        return shading.relief_image(self._depth, self._pitch_mm, self._display, self.range_mm)

    def height(self) -> NDArray[np.uint8]:
        """Return the height map."""
        rgb = self._shaded if self._display.relief else self._flat
        return self._within(rgb.copy())

    def normals(self) -> NDArray[np.uint8]:
        """Return the normals or the slope as colours."""
        assert self._raw.normals is not None
        normals = shading.shrink_to(self._raw.normals, self._px)
        if self._wanted.normals == "slope":
            return self._within(_in_colours(shading.steepness_deg(normals), slope_scale()))
        return self._within(shading.normal_colours(normals))

    def quality(self) -> tuple[NDArray[np.uint8] | None, float]:
        """Return the image of the quality view, with the value at the upper end of the colours."""
        sd, top = self._raw.depth_sd_mm, self._misfit_top
        if self._misfit is not None:
            rows, columns = self._depth.shape
            resized = cv2.resize(np.nan_to_num(self._misfit), (columns, rows))
            values = np.asarray(resized, np.float32)
        elif self._wanted.quality == "uncertainty":
            if sd is None:
                return None, 0.0
            values = np.asarray(shading.shrink_to(sd, self._px), np.float32)
            inside = values[self._outside == 0]
            top = float(np.percentile(inside, 99.0)) if inside.size else 1.0
        else:
            return self._within(self._flag_image()), 0.0
        return self._within(
            shading.apply_colour_map(values, colour_table("inferno"), 0.0, top)
        ), top

    def _flag_image(self) -> NDArray[np.uint8]:
        """Return the flags over the dimmed relief."""
        grey = cv2.cvtColor(self._shaded, cv2.COLOR_RGB2GRAY)
        dim = cv2.convertScaleAbs(cv2.merge([grey] * 3), alpha=0.6, beta=25)
        return shading.flag_colours(np.asarray(dim, np.uint8), self._flags)

    def _within(self, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
        return shading.fill_outside(rgb, self._outside)

    def surface(self) -> DisplaySurface | None:
        """Return the mesh nodes, their colours and the colour scale."""
        still, texture, scale = self._wanted.still, self._shaded, self._depth_scale()
        if self._display.colour_by != "depth":
            rgb, scale = self._quantity()
            texture = np.asarray(cv2.multiply(rgb, self._light(), scale=1 / 255.0), np.uint8)
        # The surface ends between pixels, so its rim needs colours a little farther out.
        beyond = np.asarray(cv2.erode(self._outside, np.ones((5, 5), np.uint8)), np.uint8)
        return surface_of(
            self._map,
            shading.fill_outside(texture.copy(), beyond),
            scale,
            range_mm=self.range_mm,
            largest=None if still else LIVE_NODES,
            depth_mm=None if still else self._depth,
        )

    def _quantity(self) -> tuple[NDArray[np.uint8], ColourScale]:
        """Return the colours of the surface, without shading, with the colour scale.

        If it is not available (no reference, no uncertainty of a live image), use the depth.
        """
        display, sd, reference = self._display, self._map.depth_sd_mm, self._wanted.reference
        if display.colour_by == "slope":
            slope_x, slope_y = shading.slopes(self._depth, self._pitch_mm)
            slope = np.degrees(np.arctan(cv2.magnitude(slope_x, slope_y)))
            scale = slope_scale()
            return self._with_contours(_in_colours(slope, scale)), scale
        if display.colour_by == "flags":
            scale = flag_scale()
            plain = np.broadcast_to(scale.table[0], (*self._depth.shape, 3)).copy()
            return shading.flag_colours(plain, self._flags), scale
        if display.colour_by == "uncertainty" and sd is not None:
            values = 1e3 * shading.shrink_to(sd, self._px)
            scale = uncertainty_scale(values[self._outside == 0])
            return self._with_contours(_in_colours(values, scale)), scale
        if display.colour_by == "difference" and reference is not None:
            change = subtract_map(self._raw, reference.heightmap)
            values = shading.shrink_to(np.where(change.known, change.depth_mm, np.nan), self._px)
            scale = difference_scale(values[self._outside == 0])
            return self._with_contours(_in_colours(np.nan_to_num(values), scale)), scale
        return self._flat, self._depth_scale()

    def _depth_scale(self) -> ColourScale:
        title = "processed (mm)" if self._steps else ""
        return depth_scale(self._display.colours, self.range_mm, title)

    def _with_contours(self, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
        return shading.with_contours(rgb, self._depth, self._display.contour_mm)

    def _light(self) -> NDArray[np.uint8]:
        """Return the relief under the lamp, without colours."""
        table = np.full((256, 3), 255, np.uint8)
        light, exaggeration = self._display.light, self._display.exaggeration
        return shading.shade_relief(
            self._depth, self._pitch_mm, table, self.range_mm, light, exaggeration=exaggeration
        )


def _in_colours(values: NDArray[Any], scale: ColourScale) -> NDArray[np.uint8]:
    return shading.apply_colour_map(
        np.asarray(values, np.float32), scale.table, scale.low, scale.high
    )
