"""Frames of a calibrated sensor with one change each: what is found, and what is named.

    python -m tests.studies.changed_frames SESSION CALIBRATION OUT PRESS ... [--only KEY ...]

Each change is made in the image of each press, which is then measured in every effort. What is
measured in the image as it is counts as the truth: the table shows what the change does.

- A frame is *silent* if it is "ok" and a size or the height is wrong by more than 3 sd.
- It is *spared* if it is "ok" and right, *warned* if it is doubtful and right.
- A first cause is *false* if the first finding of the frame is not one of the true ones.
"""

import argparse
import re
import zlib
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

import gelpolight_core as gp
from gelpolight_core.base.atomic_write import write_json
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Finding
from gelpolight_core.image.linear_image import linear_image
from gelpolight_core.measurement.map_reliability import with_map_findings
from gelpolight_core.measurement.measurable_depth import measurable_depth
from gelpolight_core.measurement.object_measurement import measure_heightmap
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.reconstruction.trace import EFFORTS
from gelpolight_core.session.session_images import read_raw_image

from .changed_sessions import Levels, from_middle, gain, moved, paler, shaded

SIGMAS = 3.0
"""Deviations from which on an error is silent or a warning is due."""
LIGHT = "light|exposure|led_|uneven"
PROCESSED = "compressed|processes|blurred|detail|resized|unmodelled"
DAMAGED = "dirt|damage|patch|membrane|unmodelled"
"""Regular expressions that are found in "key: text" of true causes."""


@dataclass(frozen=True, slots=True)
class Scene:
    """What a change may use of a frame beside its levels.

    Attributes
    ----------
    bare : Levels
        The untouched membrane.
    middle : (x, y)
        Middle of the contact, in widths of the image from its middle.
    random : numpy.random.Generator
        The same for the same frame.
    """

    bare: Levels
    middle: tuple[float, float]
    random: np.random.Generator


FrameChange = Callable[[Levels, Scene], Levels]


@dataclass(frozen=True, slots=True)
class ChangedFrame:
    """One change of a frame: its name, its function, and what may be said of it first."""

    key: str
    change: FrameChange
    cause: str


def plain(change: Callable[[Levels], Levels]) -> FrameChange:
    """Return a change that needs nothing but the image."""
    return lambda image, _: change(image)


def blend(share: float) -> FrameChange:
    """Return temporal noise reduction: a share of the frame before, which shows no contact."""
    return lambda image, scene: (1.0 - share) * image + share * scene.bare


def rows(share: Callable[[Levels], Levels], *channels: int) -> FrameChange:
    """Return light that changes by row, as a function of the place 0..1 from top to bottom."""

    def change(image: Levels, scene: Scene) -> Levels:
        factor = 1.0 + share(np.linspace(0.0, 1.0, len(image)) + scene.random.uniform())
        result = image.copy()
        for k in channels or (0, 1, 2):
            result[..., k] *= factor[:, None]
        return result

    return change


def flicker(size: float, periods: float, *channels: int) -> FrameChange:
    """Return light that flickers under a rolling shutter."""
    return rows(lambda y: size * np.sin(2.0 * np.pi * periods * y), *channels)


def step(size: float, at: float) -> FrameChange:
    """Return an exposure that changes in mid frame."""
    return lambda image, _: (
        image * np.where(np.arange(len(image)) < at * len(image), 1.0, 1.0 + size)[:, None, None]
    )


def coloured(matrix: Iterable[Iterable[float]]) -> FrameChange:
    """Return colours mixed by a matrix."""
    mixed = np.array([list(row) for row in matrix])
    return lambda image, _: image @ mixed.T


def saturation(size: float) -> FrameChange:
    """Return colours with more saturation, by the luminance of ITU-R BT.601."""
    luminance = np.array([0.299, 0.587, 0.114])
    return coloured((1.0 + size) * np.eye(3) - size * luminance[None, :])


def smooth(image: Levels, sigma_px: float) -> Levels:
    """Return an image that is blurred."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px))


def chroma(image: Levels) -> Levels:
    """Return an image with a quarter of its colour, as in 4:2:0."""
    full = np.clip(image, 0, 255).astype(np.float32)
    luma, red, blue = cv2.split(cv2.cvtColor(full / 255.0, cv2.COLOR_RGB2YCrCb))
    size = luma.shape[1::-1]
    half = [
        cv2.resize(part, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for part in (red, blue)
    ]
    back = [cv2.resize(part, size, interpolation=cv2.INTER_LINEAR) for part in half]
    return 255.0 * cv2.cvtColor(cv2.merge([luma, *back]), cv2.COLOR_YCrCb2RGB).astype(np.float64)


def scaled(factor: float) -> Callable[[Levels], Levels]:
    """Return an image that was made smaller and enlarged again."""

    def change(image: Levels) -> Levels:
        small = cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
        return np.asarray(cv2.resize(small, image.shape[1::-1], interpolation=cv2.INTER_LINEAR))

    return change


def interlaced(image: Levels) -> Levels:
    """Return an image whose odd rows are those above them."""
    result = image.copy()
    result[1::2] = result[: 2 * (len(image) // 2) : 2]
    return result


def jpeg(image: Levels) -> Levels:
    """Return an image that was compressed."""
    coded = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    _, data = cv2.imencode(".jpg", coded[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 70])
    return cv2.imdecode(data, cv2.IMREAD_COLOR)[..., ::-1].astype(np.float64)


def palette(image: Levels) -> Levels:
    """Return an image with 6 x 7 x 6 colours, as of a palette."""
    steps = np.array([5.0, 6.0, 5.0]) / 255.0
    return np.rint(image.clip(0, 255) * steps) / steps


def median(image: Levels) -> Levels:
    """Return an image without grain."""
    return cv2.medianBlur(np.clip(np.rint(image), 0, 255).astype(np.uint8), 3).astype(np.float64)


def tone_mapped(image: Levels) -> Levels:
    """Return an image with local tone mapping."""
    light = image.mean(axis=2) + 1.0
    around = smooth(light, 0.05 * image.shape[1])
    return image * ((light / around) ** 0.15)[..., None]


def tone(strength: float) -> Callable[[Levels], Levels]:
    """Return an image with an S-shaped curve of contrast."""

    def change(image: Levels) -> Levels:
        share = image.clip(0, 255) / 255.0
        return image * (1.0 + strength * (share - 0.5) * (1.0 - share) * 4.0)

    return change


def crop(x_px: int, y_px: int) -> Callable[[Levels], Levels]:
    """Return an image that the firmware crops at another place."""
    return lambda image: np.roll(image, (y_px, x_px), (0, 1))


def at_contact(
    light: Callable[[Levels, Levels, np.random.Generator], Levels], x: float, y: float
) -> FrameChange:
    """Return an image with a share of its light, by the place from a point near the contact."""

    def change(image: Levels, scene: Scene) -> Levels:
        u, v = from_middle(image)
        near = (scene.middle[0] + x, scene.middle[1] + y)
        return image * light(u - near[0], v - near[1], scene.random)[..., None]

    return change


def hair(x: Levels, y: Levels, _: np.random.Generator) -> Levels:
    """Return the light beside a hair."""
    curve = np.abs(y - 0.4 * x - 0.02 * np.sin(32.0 * x))
    return np.interp(curve + (np.abs(x) > 0.12), (0.001, 0.002), (0.4, 1.0))


def bubble(x: Levels, y: Levels, _: np.random.Generator) -> Levels:
    """Return the light of an air bubble: dark at one side, bright at the other."""
    radius = np.hypot(x, y) / 0.025
    return 1.0 + 0.5 * (x / 0.025) * np.exp(-4.0 * (radius - 0.7) ** 2) * (radius < 1.5)


def patch(image: Levels, scene: Scene) -> Levels:
    """Return an image with a delaminated patch, which is brighter."""
    x, y = from_middle(image)
    radius = np.hypot(x + 0.2 * np.sign(scene.middle[0] + 0.01), y - 0.1)
    return image * (1.0 + 0.12 * np.interp(radius, (0.045, 0.06), (1.0, 0.0)))[..., None]


def torn(image: Levels, scene: Scene) -> Levels:
    """Return an image of a gel that is torn at the rim."""
    x, y = from_middle(image)
    side = -np.sign(scene.middle[0] + 0.01)
    jagged = 0.25 + 0.02 * np.sin(60.0 * y) + 0.01 * np.sin(171.0 * y)
    inside = (side * x > jagged) & (np.abs(y) < 0.12)
    return np.where(inside[..., None], 0.35 * image + 20.0, image)


def oily(image: Levels, scene: Scene) -> Levels:
    """Return an image through an oil film: smooth blotches."""
    noise = scene.random.standard_normal(image.shape[:2])
    film = smooth(noise, 0.04 * image.shape[1])
    return image * (1.0 + 0.02 * film / film.std())[..., None]


def speckled(image: Levels, scene: Scene) -> Levels:
    """Return an image through dust on the lens: soft dark spots."""
    x, y = from_middle(image)
    light = np.ones(image.shape[:2])
    for u, v in scene.random.uniform(-0.25, 0.25, (12, 2)):
        light *= 1.0 - 0.08 * np.exp(-0.5 * (np.hypot(x - u, y - v) / 0.008) ** 2)
    return image * light[..., None]


def yellow(image: Levels) -> Levels:
    """Return an image through a gel that has become yellow, more so where the light goes far."""
    x, y = from_middle(image)
    far = 1.0 + 4.0 * (x**2 + y**2)
    return image * np.exp(-np.array([0.0, 0.01, 0.05]) * far[..., None])


def glare(image: Levels) -> Levels:
    """Return an image with a spot of sunlight."""
    x, y = from_middle(image)
    return image + 60.0 * np.exp(-0.5 * (np.hypot(x - 0.1, y + 0.12) / 0.06) ** 2)[..., None]


def dragged(image: Levels) -> Levels:
    """Return an image that moved during the exposure."""
    return np.asarray(cv2.blur(image, (9, 1)))


def half(image: Levels) -> Levels:
    """Return an image that another program rounded at half its levels."""
    return 2.0 * np.rint(0.5 * image)


def cases() -> Iterable[ChangedFrame]:
    """Return all changes."""
    rolling = "by row|mid frame|rows"
    shifted = "camera_moved|shifted|membrane has moved"
    blended = "blend|contrast|frame before"
    curved = "tone|contrast|curve|processes"
    mixing = "colours are mixed|colour_mixing|mixes"
    return (
        ChangedFrame("as-it-is", plain(lambda image: image), "nothing"),
        ChangedFrame("blend-5", blend(0.05), blended),
        ChangedFrame("blend-15", blend(0.15), blended),
        ChangedFrame("flicker", flicker(0.03, 2.7), rolling),
        ChangedFrame("flicker-red", flicker(0.02, 1.6, 0), rolling),
        ChangedFrame("flicker-slow", flicker(0.025, 0.6), f"{rolling}|uneven"),
        ChangedFrame("pwm", flicker(0.025, 25.0), rolling),
        ChangedFrame("pwm-blue", flicker(0.03, 11.0, 2), rolling),
        ChangedFrame("mid-frame", step(0.03, 0.45), rolling),
        ChangedFrame("mid-frame-down", step(-0.03, 0.7), rolling),
        ChangedFrame("darker", plain(gain(0.97)), LIGHT),
        ChangedFrame("half-light", plain(gain(0.5)), LIGHT),
        ChangedFrame("red-aged", plain(gain(0.93, 1.0, 1.0)), LIGHT),
        ChangedFrame("white-balance", plain(gain(0.95, 1.0, 1.06)), LIGHT),
        ChangedFrame("room-light", lambda image, _: image + 2.0, "room_light|black level"),
        ChangedFrame("glare", plain(glare), "uneven|room_light|light"),
        ChangedFrame(
            "shaded", plain(shaded(lambda x, y: 1.0 - 0.15 * (x**2 + y**2))), "uneven|light"
        ),
        ChangedFrame("saturation", saturation(0.08), mixing),
        ChangedFrame("paler", plain(paler), mixing),
        ChangedFrame(
            "matrix", coloured([[1.05, -0.05, 0], [-0.02, 1.04, -0.02], [0, -0.06, 1.06]]), mixing
        ),
        ChangedFrame("bgr", plain(lambda image: image[..., ::-1]), "colour_order"),
        ChangedFrame(
            "gamma",
            plain(lambda image: 255.0 * (image.clip(0.0) / 255.0) ** (1 / 1.1)),
            curved,
        ),
        ChangedFrame("tone-curve", plain(tone(0.08)), curved),
        ChangedFrame("tone-mapping", plain(tone_mapped), f"{curved}|uneven|{PROCESSED}"),
        ChangedFrame(
            "sharpened", plain(lambda i: i + 0.7 * (i - smooth(i, 1.2))), f"{PROCESSED}|sharpen"
        ),
        ChangedFrame("defocus", plain(partial(smooth, sigma_px=2.0)), "blurred|compressed"),
        ChangedFrame("4:2:0", plain(chroma), PROCESSED),
        ChangedFrame("interlaced", plain(interlaced), PROCESSED),
        ChangedFrame("binned", plain(scaled(0.5)), PROCESSED),
        ChangedFrame("jpeg", plain(jpeg), PROCESSED),
        ChangedFrame("median", plain(median), PROCESSED),
        ChangedFrame("palette", plain(palette), f"{PROCESSED}|palette"),
        ChangedFrame("half-levels", plain(half), "nothing|levels|" + PROCESSED),
        ChangedFrame("crop-8", plain(crop(8, 0)), shifted),
        ChangedFrame("crop-3", plain(crop(-2, 3)), shifted),
        ChangedFrame("turned", plain(moved(turn_deg=0.4)), f"{shifted}|{PROCESSED}"),
        ChangedFrame("zoomed", plain(moved(scale=1.008)), f"{shifted}|{PROCESSED}"),
        ChangedFrame("hair", at_contact(hair, 0.0, 0.09), DAMAGED),
        ChangedFrame("bubble", at_contact(bubble, -0.12, 0.05), DAMAGED),
        ChangedFrame("torn", torn, DAMAGED),
        ChangedFrame("patch", patch, DAMAGED),
        ChangedFrame("oil", oily, f"{DAMAGED}|uneven"),
        ChangedFrame("dust", speckled, DAMAGED),
        ChangedFrame("yellow", plain(yellow), f"{LIGHT}|gel"),
        ChangedFrame("dragged", plain(dragged), f"{PROCESSED}|still"),
    )


def contact_middle(image: Levels, bare: Levels) -> tuple[float, float]:
    """Return the middle of a contact in widths of the image from its middle."""
    change = smooth(np.abs(image - bare).sum(axis=2), 0.015 * image.shape[1])
    at = np.unravel_index(change.argmax(), change.shape)
    x, y = from_middle(image)[:, *at]
    return float(x), float(y)


Seen = tuple[Measurement | None, tuple[Finding, ...]]
"""A measurement, or None where it was refused, and the findings, the first one first."""


def seen(frame: NDArray[np.uint8], shape: str, effort: str, sensor: gp.Reconstructor) -> Seen:
    """Measure a frame, as the program does from files and live."""
    image = linear_image(frame, "frame", response=sensor.calibration.response)
    health = sensor.health(image.rgb if effort == EFFORTS[-1] else frame)
    if health.meaningless is not None:
        return None, health.findings
    try:
        if effort == EFFORTS[-1]:
            found = measurable_depth(sensor, image)
        else:
            found = sensor.at_effort(effort).depth(frame, health=health)
        result = with_map_findings(measure_heightmap(found, shape=shape), found)
    except InputError as error:
        return None, (*health.findings, Finding("refused", str(error)))
    return result, (*health.findings, *result.findings)


def deviations(result: Measurement, true: Measurement) -> list[tuple[float, float]]:
    """Return the error of size and height in percent and in standard deviations."""
    pairs = (
        (result.size_mm, true.size_mm, result.size_sd_mm),
        (result.height_mm, true.height_mm, result.height_sd_mm),
    )
    return [(100.0 * (value / right - 1.0), (value - right) / sd) for value, right, sd in pairs]


@lru_cache(maxsize=1)
def _sensor(calibration: Path) -> gp.Reconstructor:
    return gp.Reconstructor(gp.read_calibration(calibration), workers=1)


def outcome(
    session: Path, calibration: Path, press: Path, key: str, shape: str
) -> list[dict[str, Any]]:
    """Change one press in one way, and measure it in every effort."""
    sensor, case = _sensor(calibration), next(case for case in cases() if case.key == key)
    image, bare = (
        read_raw_image(path).rgb.astype(np.float64)
        for path in (press, sorted((session / "background").glob("*.png"))[0])
    )
    random = np.random.default_rng(zlib.crc32(f"{press.name} {key}".encode()))
    changed = image
    if key != "as-it-is":
        scene = Scene(bare, contact_middle(image, bare), random)
        changed = case.change(image + random.uniform(-0.5, 0.5, image.shape), scene)
    frame = np.clip(np.rint(changed), 0, 255).astype(np.uint8)
    result = []
    for effort in EFFORTS:
        true, _ = seen(image.astype(np.uint8), shape, effort, sensor)
        assert true is not None, press
        found, findings = seen(frame, shape, effort, sensor)
        flagged = [f for f in findings if found is None or f.doubtful]
        errors = [] if found is None else deviations(found, true)
        wrong = any(abs(z) > SIGMAS for _, z in errors)
        verdict = "refused" if found is None else found.verdict
        first = f"{flagged[0].key}: {flagged[0].text}" if flagged else ""
        result.append(
            {
                "sensor": session.name,
                "press": press.name,
                "key": key,
                "effort": effort,
                "verdict": verdict,
                "errors": errors,
                "silent": verdict == "ok" and wrong,
                "wrong": wrong,
                "first": first,
                "true": bool(re.search(case.cause, first)) if flagged else None,
                "findings": [f.key for f in findings],
            }
        )
    return result


def line(row: dict[str, Any]) -> str:
    """Return an outcome as a line of the table."""
    named = {True: "true", False: "FALSE", None: "-"}[row["true"]]
    errors = " ".join(f"{percent:+6.1f} ({z:+5.1f})" for percent, z in row["errors"])
    state = "SILENT" if row["silent"] else ("right" if row["errors"] and not row["wrong"] else "")
    return (
        f"{row['press'][:18]:<19}{row['key']:<15}{row['effort']:<9}{row['verdict']:<9}{state:<7}"
        f"{named:<6}{errors:<30} {row['first'][:90]}"
    )


def summary(rows: Iterable[dict[str, Any]]) -> str:
    """Return what counts for each effort, as lines."""
    given, lines = list(rows), []
    for effort in EFFORTS:
        part = [row for row in given if row["effort"] == effort]
        named = [row["true"] for row in part if row["true"] is not None]
        count = {v: sum(row["verdict"] == v for row in part) for v in ("ok", "doubtful", "refused")}
        spared = sum(row["verdict"] == "doubtful" and not row["wrong"] for row in part)
        lines.append(
            f"{effort}: {len(part)} frames, {count}, {sum(row['silent'] for row in part)} silent, "
            f"{spared} doubtful ones are right, {sum(named)} of {len(named)} first causes are true"
        )
    return "\n".join(lines)


def main() -> None:
    """Print the table of a sensor."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    for name in ("session", "calibration", "out"):
        parser.add_argument(name, type=Path)
    parser.add_argument("press", nargs="+", type=Path, help="its name begins with its shape")
    keys = [case.key for case in cases()]
    parser.add_argument("--only", nargs="+", choices=keys, default=keys, metavar="KEY")
    given = parser.parse_args()
    rows: list[dict[str, Any]] = []
    with ProcessPoolExecutor(2) as pool:
        tasks = [
            pool.submit(outcome, given.session, given.calibration, press, key, shape_of(press))
            for key in given.only
            for press in given.press
        ]
        for task in tasks:
            rows += task.result()
            for row in task.result():
                print(line(row), flush=True)
    write_json(given.out, rows)
    print(summary(rows))


def shape_of(press: Path) -> str:
    """Return the shape that the name of an image begins with."""
    return press.name.partition("_")[0]


if __name__ == "__main__":
    main()
