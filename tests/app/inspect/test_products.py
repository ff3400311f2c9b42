"""What is made of a frame: what is looked at, and no more."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
import pytest

from app.inspect import shading
from app.inspect.cuts import Section
from app.inspect.look import Light, Look, colour_table
from app.inspect.products import QUALITY_COLOURS, SURROUND, Maker, Wanted
from app.inspect.surface import LIVE_NODES, surface_of
from app.sources.source import Frame
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.reconstruction.heightmap import Flag, HeightMap


@dataclass
class Reconstruction:
    """Stands for a Reconstructor; notes what it was asked for."""

    heightmap: HeightMap
    asked: list[dict[str, Any]] = field(default_factory=list)

    def depth(self, frame: Any, **wanted: Any) -> HeightMap:
        self.asked.append(wanted)
        return self.heightmap


@pytest.fixture
def frame() -> Frame:
    return Frame(np.zeros((4, 6, 3), np.uint8), 0, 0.0)


def _made(dome: HeightMap, frame: Frame, **wanted: Any) -> tuple[Any, Reconstruction]:
    reconstruction = Reconstruction(dome)
    maker = Maker(reconstruction)  # type: ignore[arg-type]
    maker.wanted = Wanted(**wanted)
    return maker(frame), reconstruction


@pytest.mark.parametrize("view", ["height", "normals", "quality", "surface"])
def test_only_the_view_that_is_shown_is_computed(dome: HeightMap, frame: Frame, view: str) -> None:
    wanted = {"quality": "flags", "normals": "normals"}.get(view, True)
    shown, _ = _made(dome, frame, **{view: wanted})
    made = {f.name for f in fields(shown) if f.name in ("height", "normals", "quality", "surface")}
    assert {name for name in made if getattr(shown, name) is not None} == {view}
    assert shown.cut is None


def test_with_only_the_camera_shown_nothing_is_reconstructed(dome: HeightMap, frame: Frame) -> None:
    shown, reconstruction = _made(dome, frame, camera=True)
    assert shown.heightmap is None
    assert reconstruction.asked == []


def test_hidden_normals_are_not_asked_for(dome: HeightMap, frame: Frame) -> None:
    _, reconstruction = _made(dome, frame, height=True)
    assert reconstruction.asked == [{"normals": False, "uncertainty": False}]


@pytest.mark.parametrize(("still", "expected"), [(False, False), (True, True)])
def test_uncertainty_is_asked_for_of_a_standing_picture_only(
    dome: HeightMap, frame: Frame, still: bool, expected: bool
) -> None:
    _, reconstruction = _made(dome, frame, quality="uncertainty", still=still)
    assert reconstruction.asked[0]["uncertainty"] is expected


def test_another_look_at_a_standing_picture_reconstructs_nothing_anew(
    dome: HeightMap, frame: Frame
) -> None:
    reconstruction = Reconstruction(dome)
    maker = Maker(reconstruction)  # type: ignore[arg-type]
    maker.wanted = Wanted(height=True, still=True)
    before = maker(frame)
    maker.wanted = Wanted(height=True, still=True, look=Look(colours="inferno"))
    after = maker(frame)
    assert len(reconstruction.asked) == 1
    assert not np.array_equal(before.height, after.height)


def test_the_profile_on_screen_is_the_core_s(dome: HeightMap, frame: Frame) -> None:
    from gelpolight_core.measurement.profile import take_profile, width_at

    section = Section((-4.0, -1.0), (7.0, -1.0), 0.2)
    shown, _ = _made(dome, frame, section=section, region=Rectangle((0.0, 4.0), (2.0, 2.0)))
    expected = take_profile(dome, section.start_mm, section.end_mm, width_mm=0.2)
    np.testing.assert_array_equal(shown.cut.profile.depth_mm, expected.depth_mm)
    figures = {figure.name: figure.value for figure in shown.cut.figures}
    assert figures["width"] == width_at(expected).value
    assert {"step_height", "slope", "angle", "sa", "sq", "sz"} <= set(figures)


def test_the_width_is_measured_at_the_level_that_is_chosen(dome: HeightMap, frame: Frame) -> None:
    line = (-4.0, -1.0), (7.0, -1.0)
    half, _ = _made(dome, frame, section=Section(*line))
    low, _ = _made(dome, frame, section=Section(*line, level_mm=0.1))
    assert half.cut.width_ends is not None and low.cut.width_ends is not None
    assert half.cut.width_ends[2] == pytest.approx(0.4, abs=0.01)
    assert low.cut.width_ends[2] == 0.1
    left, right, _level = low.cut.width_ends
    width = next(f.value for f in low.cut.figures if f.name == "width")
    assert width == pytest.approx(right - left)
    # The dome is 0.8 - (r / 3)^2 deep.
    assert width == pytest.approx(2.0 * 3.0 * np.sqrt(0.7), abs=0.05)


def test_a_line_beside_the_sensor_says_so_and_measures_nothing(
    dome: HeightMap, frame: Frame
) -> None:
    shown, _ = _made(dome, frame, section=Section((40.0, 40.0), (44.0, 40.0)))
    assert shown.cut.profile is None
    assert "outside" in shown.cut.sentences[0]


def test_the_live_mesh_is_coarse_and_the_standing_one_has_every_node(dome: HeightMap) -> None:
    texture = np.zeros((8, 8, 3), np.uint8)
    live = surface_of(dome, texture, largest=60)
    whole = surface_of(dome, texture)
    assert live is not None and whole is not None
    assert max(live.depth_mm.shape) <= 61 < LIVE_NODES
    assert whole.depth_mm.shape[1] == dome.depth_mm.shape[1]


def test_the_mesh_ends_at_the_rim_and_has_the_map_s_depth(dome: HeightMap) -> None:
    surface = surface_of(dome, np.zeros((8, 8, 3), np.uint8))
    assert surface is not None
    rim = np.hypot(surface.x_mm[:, [0, -1]], surface.y_mm[:, None])
    assert np.abs(rim[5:-5] - 8.0).max() < 0.15
    places = np.array([2.0, -3.0, 30.0]), np.array([-1.0, 0.0, 0.0])
    assert surface.depth_at(*places) == pytest.approx([0.8, 0.0, -np.inf], abs=0.01)


def test_the_side_towards_the_light_is_brighter() -> None:
    x = np.linspace(-3.0, 3.0, 121)
    dome = np.maximum(1.0 - 0.2 * (x[:, None] ** 2 + x**2), 0.0).astype(np.float32)
    grey = np.full((256, 3), 128, np.uint8)
    lit = shading.shaded(dome, 0.05, grey, (0.0, 1.0), Light(azimuth_deg=270.0))
    assert lit[60, 40].mean() > lit[60, 60].mean() > lit[60, 80].mean()


@pytest.mark.parametrize("shade", [False, True])
def test_contour_lines_lie_where_the_depth_is_a_multiple_of_the_step(
    shade: bool,
) -> None:
    ramp = np.broadcast_to(np.linspace(0.0, 1.0, 401, dtype=np.float32), (50, 401)).copy()
    white = np.full((50, 401, 3), 255, np.uint8)
    lit = shading.with_contours(white, ramp, 0.25)
    if shade:
        lit = shading.shaded(ramp, 1.0, white[0, :256], (0.0, 1.0), Light(), contour_mm=0.25)
    lines = lit[25, :, 0]
    dark = np.flatnonzero(lines < 0.6 * lines.max())
    assert {round(0.0025 * k, 2) for k in dark} == {0.25, 0.5, 0.75, 1.0}


def test_colours_say_the_same_depth_whatever_the_frame_when_the_range_is_locked() -> None:
    table = colour_table("viridis")
    one = shading.coloured(np.full((2, 2), 0.5, np.float32), table, 0.0, 1.0)
    np.testing.assert_array_equal(one[0, 0], table[128])
    below = shading.coloured(np.full((2, 2), -3.0, np.float32), table, 0.0, 1.0)
    np.testing.assert_array_equal(below[0, 0], table[0])


def test_flags_have_their_colour_and_the_outside_is_no_flag(dome: HeightMap, frame: Frame) -> None:
    shown, _ = _made(dome, frame, quality="flags", still=True)
    assert tuple(shown.quality[85, 45]) == QUALITY_COLOURS[Flag.DARK]
    assert tuple(shown.quality[0, 0]) == SURROUND


def test_the_slope_view_is_the_angle_of_the_normals() -> None:
    tilt = np.radians([0.0, 30.0, 60.0])
    normals = np.stack([np.sin(tilt), 0.0 * tilt, -np.cos(tilt)], axis=-1)[None]
    found = shading.steepness_deg(normals.astype(np.float32))
    np.testing.assert_allclose(found, [[0.0, 30.0, 60.0]], atol=0.1)
