"""What is computed from a frame: only what is shown."""

from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
import pytest

from app.live.frame_processor import FrameProcessor, FrameRequest
from app.program.display import QUANTITIES, DisplaySettings
from app.sources.source import SourceFrame
from app.views.map import shading
from app.views.map.colour_tables import SURROUND
from app.views.map.display_processing import ProcessingSteps
from app.views.map.quantities import FLAG_COLOURS, ReferenceMap
from app.views.map.sections import SectionSettings
from app.views.surface.display_surface import LIVE_NODES
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.reconstruction.height_map import Flag, HeightMap


@dataclass
class Reconstruction:
    """Replaces a Reconstructor and records its calls."""

    heightmap: HeightMap
    asked: list[dict[str, Any]] = field(default_factory=list)

    def depth(self, frame: Any, **wanted: Any) -> HeightMap:
        self.asked.append(wanted)
        return self.heightmap


@pytest.fixture
def frame():
    return SourceFrame(np.zeros((4, 6, 3), np.uint8), 0, 0.0)


def _made(dome: HeightMap, frame: SourceFrame, **wanted: Any) -> tuple[Any, Reconstruction]:
    reconstruction = Reconstruction(dome)
    processor = FrameProcessor(reconstruction)  # type: ignore[arg-type]
    processor.wanted = FrameRequest(**wanted)
    return processor(frame), reconstruction


@pytest.mark.parametrize("view", ["height", "normals", "quality", "surface"])
def test_only_the_view_that_is_shown_is_computed(dome, frame, view):
    wanted = {"quality": "flags", "normals": "normals"}.get(view, True)
    shown, _ = _made(dome, frame, **{view: wanted})
    made = {f.name for f in fields(shown) if f.name in ("height", "normals", "quality", "surface")}
    assert {name for name in made if getattr(shown, name) is not None} == {view}
    assert shown.cut is None


@pytest.mark.function("See flags, misfit and uncertainty")
@pytest.mark.parametrize("still", [False, True])
def test_uncertainty_is_computed_for_frozen_images_only(dome, frame, still):
    _, reconstruction = _made(dome, frame, quality="uncertainty", still=still)
    assert reconstruction.asked[0]["uncertainty"] is still


def test_the_profile_on_screen_equals_that_of_the_core(dome, frame):
    from gelpolight_core.measurement.profile import take_profile, width_at

    section = SectionSettings((-4.0, -1.0), (7.0, -1.0), width_mm=0.2)
    shown, _ = _made(dome, frame, section=section, region=Rectangle((0.0, 4.0), (2.0, 2.0)))
    expected = take_profile(dome, section.start_mm, section.end_mm, width_mm=0.2)
    np.testing.assert_array_equal(shown.cut.profile.depth_mm, expected.depth_mm)
    figures = {figure.name: figure.value for figure in shown.cut.figures}
    assert figures["width"] == width_at(expected).value
    assert {"step_height", "sa", "sq", "sz"} <= set(figures)


def test_the_width_is_measured_at_the_level_that_is_chosen(dome, frame):
    section = SectionSettings((-4.0, -1.0), (7.0, -1.0))
    half, _ = _made(dome, frame, section=section)
    low, _ = _made(dome, frame, section=replace(section, level_mm=0.1))
    assert half.cut.width_ends[2] == pytest.approx(0.4, abs=0.01)
    assert low.cut.width_ends[2] == 0.1
    left, right, _level = low.cut.width_ends
    width = next(f.value for f in low.cut.figures if f.name == "width")
    assert width == pytest.approx(right - left)
    # The dome is 0.8 - (r / 3)^2 deep.
    assert width == pytest.approx(2.0 * 3.0 * np.sqrt(0.7), abs=0.05)
    off, _ = _made(dome, frame, section=SectionSettings((40.0, 40.0), (44.0, 40.0)))
    assert off.cut.profile is None and "outside" in off.cut.sentences[0]


@pytest.mark.function("Colour the surface by another quantity")
@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("still", [False, True])
def test_the_surface_shows_each_quantity_with_its_own_scale(dome, frame, quantity, still):
    sd = np.full_like(dome.depth_mm, 0.003)
    before = replace(dome, depth_mm=dome.depth_mm - np.float32(0.05))
    shown, _ = _made(
        replace(dome, depth_sd_mm=sd), frame, surface=True, still=still,
        display=DisplaySettings(colour_by=quantity), reference=ReferenceMap(before),
    )  # fmt: skip
    scale = shown.surface.scale
    expected = {
        "depth": shown.range_mm, "slope": (0.0, 60.0), "uncertainty": (0.0, 5.0),
        "difference": (-0.05, 0.05), "flags": (0.0, 1.0),
    }  # fmt: skip
    assert (scale.low, scale.high) == pytest.approx(expected[quantity])
    assert bool(scale.names) == (quantity == "flags")
    live, _ = _made(
        replace(dome, depth_sd_mm=sd), frame, surface=True,
        display=DisplaySettings(colour_by=quantity), reference=ReferenceMap(before),
    )  # fmt: skip
    if not still or quantity != "uncertainty":  # live, the depth is shown instead
        np.testing.assert_array_equal(shown.surface.texture, live.surface.texture)
    largest = max(shown.surface.depth_mm.shape)
    assert largest == max(dome.depth_mm.shape) if still else largest <= LIVE_NODES


def test_a_frozen_height_map_is_shown_and_measured_as_processed(dome, frame):
    tilt = 0.02 * dome.x_mm.astype(np.float32)
    tilted = replace(dome, depth_mm=dome.depth_mm + tilt)
    steps = ProcessingSteps(
        reference=ReferenceMap(replace(dome, depth_mm=0.0 * dome.depth_mm + tilt))
    )
    line = SectionSettings((-6.0, -1.0), (6.0, -1.0))
    views = {"surface": True, "section": line, "quality": "flags", "processing": steps}
    shown, _ = _made(tilted, frame, still=True, **views)
    np.testing.assert_allclose(shown.heightmap.depth_mm, dome.depth_mm, atol=1e-6)
    assert float(np.nanmax(shown.cut.profile.depth_mm)) == pytest.approx(0.8, abs=2e-3)
    assert float(shown.surface.depth_mm.max()) == pytest.approx(0.8, abs=1e-3)
    plain, _ = _made(tilted, frame, still=True, surface=True)
    assert shown.surface.scale.title != plain.surface.scale.title
    assert shown.processed and shown.raw is tilted
    live, _ = _made(tilted, frame, **views)
    assert live.heightmap is tilted and not live.processed


@pytest.mark.parametrize("shade", [False, True])
def test_contour_lines_lie_where_the_depth_is_a_multiple_of_the_step(shade):
    ramp = np.broadcast_to(np.linspace(0.0, 1.0, 401, dtype=np.float32), (50, 401)).copy()
    white = np.full((50, 401, 3), 255, np.uint8)
    lit = shading.with_contours(white, ramp, 0.25)
    if shade:
        lit = shading.shade_relief(
            ramp, 1.0, white[0, :256], (0.0, 1.0), DisplaySettings().light, contour_mm=0.25
        )
    lines = lit[25, :, 0]
    dark = np.flatnonzero(lines < 0.6 * lines.max())
    assert {round(0.0025 * k, 2) for k in dark} == {0.25, 0.5, 0.75, 1.0}


def test_flags_have_their_colour_and_the_outside_is_no_flag(dome, frame):
    shown, _ = _made(dome, frame, quality="flags", still=True)
    assert tuple(shown.quality[85, 45]) == FLAG_COLOURS[Flag.DARK]
    assert tuple(shown.quality[0, 0]) == SURROUND


def test_the_slope_view_is_the_angle_of_the_normals():
    tilt = np.radians([0.0, 30.0, 60.0])
    normals = np.stack([np.sin(tilt), 0.0 * tilt, -np.cos(tilt)], axis=-1)[None]
    found = shading.steepness_deg(normals.astype(np.float32))
    np.testing.assert_allclose(found, [[0.0, 30.0, 60.0]], atol=0.1)


def test_a_stored_image_that_is_shown_by_itself_has_its_own_colour_range(dome, frame):
    reconstruction = Reconstruction(dome)
    processor = FrameProcessor(reconstruction)  # type: ignore[arg-type]
    processor.wanted = FrameRequest(height=True)
    ranges = []
    for factor, paused in ((2.0, False), (1.0, False), (1.0, True), (1.0, False)):
        deeper = replace(dome, depth_mm=np.float32(factor) * dome.depth_mm)
        reconstruction.heightmap = deeper
        ranges.append(processor(replace(frame, paused=paused)).range_mm[1])
    assert ranges == pytest.approx([2.4, 2.4, 1.2, 2.4])


def test_the_shaded_map_is_dark_where_nothing_is_measured(dome, frame):
    for still in (False, True):
        shown, _ = _made(dome, frame, surface=True, still=still)
        assert tuple(shown.surface.texture[0, 0]) == SURROUND
