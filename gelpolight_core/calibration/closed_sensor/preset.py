"""Presets of closed sensors: manufacturers' data as start values for in-place calibration."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from gelpolight_core.base.codec import place, unpack_toml
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.limits import Span, Words
from gelpolight_core.base.safe_reading import NAME_LIMIT, read_toml, short_repr
from gelpolight_core.session.session import SCALE_RANGE

FOLDER = Path(__file__).with_name("presets")
FORMAT, VERSION = "gelpolight-preset", 1
SAME_SHAPE = 0.02
"""Largest relative difference of the aspect ratios of an image and a preset."""
COLOURED = 3
"""Number of light colours that is necessary for slopes in all directions."""

Px = Annotated[int, Span(32, 20_000)]
Mm = Annotated[float, Span(0.1, 1000.0)]
Share = Annotated[float, Span(0.0, 0.45)]
Gain = Annotated[float, Span(0.0, 100.0)]


@dataclass(frozen=True, slots=True)
class Preset:
    """A kind of closed sensor.

    Attributes
    ----------
    name : str
        As people call it.
    light_colours : int
        Colours of its lights; slopes need three.
    camera_px : (int, int)
        Width and height of the camera's own format.
    cropped : (float, float, float, float)
        Share of the camera's image that is cut off: left, top, right, bottom.
    image_px : (int, int)
        Usual width and height of the images after that.
    mm_per_px, mm_per_px_sd : float
        Nominal scale of such images, and how much sensors of this kind differ.
    working_area_mm : (float, float)
        Width and height of the membrane that is seen.
    marker_pitches_mm : tuple of float
        Distances of printed markers of its gels; 0 is a plain gel.
    colour_per_slope, colour_per_slope_sd : float
        Root mean square change of colour over that of the slope on pressed balls, and how much
        sensors of this kind differ; 0 where fewer than two sensors were measured.
    """

    name: Annotated[str, Words(NAME_LIMIT)]
    light_colours: Annotated[int, Span(1, 100)]
    camera_px: tuple[Px, Px] = place("camera.width_px", "camera.height_px")
    cropped: tuple[Share, Share, Share, Share] = place("camera.cropped")
    image_px: tuple[Px, Px] = place("image.width_px", "image.height_px")
    mm_per_px: Annotated[float, Span(*SCALE_RANGE)] = place("image.mm_per_px")
    mm_per_px_sd: Annotated[float, Span(0.0, SCALE_RANGE[1])] = place("image.mm_per_px_sd")
    working_area_mm: tuple[Mm, Mm] = place("working_area.width_mm", "working_area.height_mm")
    marker_pitches_mm: tuple[Annotated[float, Span(0.0, 100.0)], ...] = place("markers.pitch_mm")
    colour_per_slope: Gain = place("gel.colour_per_slope", default=0.0)
    colour_per_slope_sd: Gain = place("gel.colour_per_slope_sd", default=0.0)

    @property
    def limits(self) -> str:
        """What the program cannot do with this kind of sensor, or "" without a limit."""
        if self.light_colours >= COLOURED:
            return ""
        return (
            "The lights of this sensor have one colour, which cannot show the "
            "direction of a slope: the calibration will probably fail"
        )

    def scale_for(self, width_px: int, height_px: int) -> tuple[float, float]:
        """Return the scale (mm per pixel) for images of another size with its standard deviation.

        Parameters
        ----------
        width_px, height_px : int
            Size of the images as they are calibrated, cropped as stated.

        Raises
        ------
        InputError
            If they have another shape, so that they are cropped otherwise.
        """
        width, height = self.image_px
        if abs(width_px * height / (height_px * width) - 1.0) > SAME_SHAPE:
            text = (
                f"The images have {width_px}x{height_px} pixels; the preset {self.name} is for the "
                f"shape {width}x{height}"
            )
            advice = "Crop and turn the images as the preset states, or state the scale"
            raise InputError(text, "mm_per_px", advice)
        share = width / width_px
        return self.mm_per_px * share, self.mm_per_px_sd * share


@functools.cache
def presets() -> Mapping[str, Preset]:
    """Return the presets that come with the program by their keys, such as ``gelsight-mini``."""
    by_key = {path.stem: read_preset(path) for path in FOLDER.glob("*.toml")}
    return dict(sorted(by_key.items(), key=lambda item: item[1].name))


def preset_named(key: str) -> Preset:
    """Return one of the presets that come with the program, or one of a file.

    Parameters
    ----------
    key : str
        Such as ``gelsight-mini``, or the path of a TOML file.

    Raises
    ------
    InputError
        If there is no preset with that name.
    """
    if key.casefold() in presets():
        return presets()[key.casefold()]
    if key.endswith(".toml"):
        return read_preset(Path(key))
    advice = Remedy.ONE_OF.format(names=", ".join(sorted(presets())))
    raise InputError(f'There is no preset or TOML file "{short_repr(key)}"', "preset", advice)


def read_preset(path: Path) -> Preset:
    """Read a preset.

    Raises
    ------
    InputError
        If the file is missing, is not TOML, or has a key that is unknown, missing, of the wrong
        kind or out of range.
    """
    return unpack_toml(Preset, read_toml(path), path, (FORMAT, VERSION))


def stated_sizes(
    radii_mm: Iterable[float], pixel_mm: Sequence[float], image_px: tuple[int, int]
) -> str:
    """Return the stated lengths as a line that a person can confirm.

    Parameters
    ----------
    radii_mm : iterable of float
        Radii of the balls.
    pixel_mm : (x, y)
        Size of a pixel on the membrane.
    image_px : (width, height)
        Size of the images.
    """
    width, height = (size * n for size, n in zip(pixel_mm, image_px, strict=True))
    across = ", ".join([f"{2.0 * r:.4g}" for r in sorted({round(r, 6) for r in radii_mm})])
    balls = f"balls {across} mm across, {pixel_mm[0]:.4g} mm per pixel"
    return f"{balls}: the image shows {width:.3g} x {height:.3g} mm"
