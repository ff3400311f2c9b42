"""Calibrations from a session with one fault each, and whether that fault is named first.

    python -m tests.studies.changed_sessions SESSION OUT [--only KEY ...]

SESSION is an open sensor's, of a linear camera, whose presses have their true sizes in
``presses/truth.csv``. Each change is made in a copy, which is calibrated; then the presses are
measured. OUT/results.json holds all that was found; with ``--only`` others in it are kept
and are part of the last line.

- A first cause is *false* if another fault is named first than the one that was made. It is what
  the program shows as the most likely cause, or else the worst finding, or the refusal.
- An error is *silent* if a press is "ok" whose size or height is farther from the truth than its U.
- A *harmless* change leaves what is needed: one factor on all light of a channel, one bad ball of
  several, what no result depends on, or what background and presses share. With it, no calibration
  may fail, and each press must be "ok" and within its U.
"""

import argparse
import json
import re
import shutil
import tempfile
import time
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from math import cos, radians, sin
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

import gelpolight_core as gp
from gelpolight_core.base.atomic_write import write_json
from gelpolight_core.base.finding import Verdict, join_quality_tables, worst_of
from gelpolight_core.base.root_causes import best_cause
from gelpolight_core.lab.evaluation_run import evaluate_presses, press_measurement
from gelpolight_core.lab.reference_press import LENGTHS, read_truth
from gelpolight_core.session.description import write_description
from gelpolight_core.session.session import Session, read_session
from gelpolight_core.session.session_images import read_raw_image, write_image

Levels = NDArray[Any]
"""An image (rows, columns, 3), RGB, in grey levels 0..255: the light, as the camera is linear."""
ImageChange = Callable[[Levels], Levels]
SessionChange = Callable[[Path], None]
ODD, OTHER, LIKE_ODD = "ball_04.png", "ball_05.png", "ball_06.png"
"""A ball with a fault; one of another size; one of the same size."""
LENS, TOP, MIRROR, WHITE, BARE, BALLS = (
    *("checkerboard", "top_pose", "mirror", "whiteboard", "background", "balls"),
)
AFTER = (BALLS, "presses")
"""What is captured after the background, and shows what has changed by then."""
BARE_ON = (BARE, *AFTER)
LIT = (MIRROR, WHITE, *BARE_ON)
REFUSED = "refused"
LIGHT = "background_light|exposure|warm|light (has )?changed"
WORN = r"worn|coat it again|printed|coating (is|at|has a)|factor_spread|membrane_unusable"
UNMODELLED = "light model"
"""Where no other words are true, it is that the light is not as the model says."""


@dataclass(frozen=True, slots=True)
class ChangedSession:
    """One fault that is made in a session, for the table.

    Attributes
    ----------
    key, fault : str
        Its name, and what is wrong.
    change : callable
        Makes it in a session folder.
    cause : str
        Regular expression that is found in "key: text" of the first cause only if that is true.
    harmless : bool
        Whether the presses must stay right and usable.
    """

    key: str
    fault: str
    change: SessionChange
    cause: str
    harmless: bool = False


def state(change: Callable[[Session], Session]) -> SessionChange:
    """Return a change of what ``session.toml`` states."""
    return lambda folder: write_description(change(read_session(folder)))


def stated(value: Callable[[float], float], *names: str) -> SessionChange:
    """Return a change of numbers such as ``sensor.led_height_mm``."""

    def change(session: Session) -> Session:
        for table, key in (name.split(".") for name in names):
            part = getattr(session, table)
            session = replace(session, **{table: replace(part, **{key: value(getattr(part, key))})})
        return session

    return state(change)


def balls(change: Callable[[dict[str, float]], dict[str, float]]) -> SessionChange:
    """Return a change of the stated radii of the balls (mm), by their images."""

    def changed(s: Session) -> Session:
        radii_mm = {path.name: s.ball_radius_mm(path.name) for path in s.files(BALLS)}
        return replace(s, ball_radii_mm=radii_mm | change(radii_mm))

    return state(changed)


def change_image(path: Path, change: ImageChange) -> None:
    """Change the light of an image, whose rounding is undone at random and repeated."""
    rng, rounded = np.random.default_rng(zlib.crc32(path.name.encode())), read_raw_image(path).rgb
    levels = change(rounded + rng.uniform(-0.5, 0.5, rounded.shape))
    write_image(np.clip(np.rint(levels), 0, 255).astype(np.uint8), path)


def each(change: ImageChange, *images: str) -> SessionChange:
    """Return a change of some images, or of all images of some stages."""

    def change_all(folder: Path) -> None:
        for name in images:
            for path in folder.glob(name if "/" in name else f"{name}/*.png"):
                change_image(path, change)

    return change_all


def gain(*factors: float) -> ImageChange:
    """Return other light: of all channels, or of red, green and blue."""
    return lambda image: image * np.array(factors)


def warm_up(share: float, folder: Path) -> None:
    """Lose a share of the light from the first to the last ball."""
    files = sorted((folder / BALLS).glob("*.png"))
    for path, factor in zip(files, np.linspace(1.0, 1.0 - share, len(files)), strict=True):
        change_image(path, gain(float(factor)))


def from_middle(image: Levels) -> Levels:
    """Return x and y (2, rows, columns) of each pixel from the middle, in widths of the image."""
    rows, columns = image.shape[:2]
    y, x = np.mgrid[:rows, :columns]
    return np.stack([x - 0.5 * (columns - 1), y - 0.5 * (rows - 1)]) / columns


def shaded(light: Callable[[Levels, Levels], Levels]) -> ImageChange:
    """Return an image with a share of its light, by its place."""
    return lambda image: image * light(*from_middle(image))[..., None]


def fall_off(image: Levels) -> Levels:
    """Return an image with 6 % less light in the corners, as with another aperture."""
    return shaded(lambda x, y: 1.0 - 0.154 * (x**2 + y**2))(image)


def spot(light: float) -> ImageChange:
    """Return an image with a dark spot of 2 mm, whose edge is as blurred as a lens makes it."""
    return shaded(lambda x, y: np.interp(np.hypot(x + 0.2, y - 0.09), (0.029, 0.031), (light, 1.0)))


def dots(light: float) -> ImageChange:
    """Return an image with dots of 0.3 mm every 1.6 mm, if 26 mm are 0.8 widths."""

    def share(x: Levels, y: Levels) -> Levels:
        radius = np.hypot(x % 0.05 - 0.025, y % 0.05 - 0.025)
        return np.interp(radius, (0.004, 0.006), (light, 1.0))

    return shaded(share)


def hair(folder: Path) -> None:
    """Lay a hair over the contact of a ball; between gel and camera, it only takes light."""
    untouched = read_raw_image(next((folder / BARE).glob("*.png"))).rgb

    def change(image: Levels) -> Levels:
        pressed = cv2.GaussianBlur(np.abs(image - untouched).sum(axis=2), (0, 0), 20.0)
        middle = from_middle(image)[:, *np.unravel_index(pressed.argmax(), pressed.shape)]

        def light(u: Levels, v: Levels) -> Levels:
            x, y = u - middle[0], v - middle[1]
            curve = np.abs(y - 0.4 * x - 0.02 * np.sin(32.0 * x))
            return np.interp(curve + (np.abs(x) > 0.12), (0.001, 0.002), (0.4, 1.0))

        return shaded(light)(image)

    change_image(folder / BALLS / ODD, change)


def bent(source: Callable[[Levels], Levels]) -> ImageChange:
    """Return an image whose pixels are those at other places, in widths from the middle."""

    def change(image: Levels) -> Levels:
        rows, columns = image.shape[:2]
        x, y = (columns * source(from_middle(image))).astype(np.float32)
        x, y = x + 0.5 * (columns - 1), y + 0.5 * (rows - 1)
        return np.asarray(cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))

    return change


def barrel(at: Levels) -> Levels:
    """Return places that a lens moves inwards by 3 % in the corners of an image of 4 to 3."""
    return at * (1.0 + 0.077 * np.square(at).sum(axis=0))


def moved(x_px: float = 0.0, turn_deg: float = 0.0, scale: float = 1.0) -> ImageChange:
    """Return an image that is enlarged, turned, and moved by pixels of an image 1280 wide."""
    c, s = cos(radians(turn_deg)) / scale, sin(radians(turn_deg)) / scale
    return bent(lambda at: np.stack([c * at[0] - s * at[1] - x_px / 1280, s * at[0] + c * at[1]]))


def narrow_squares(factor: float, folder: Path) -> None:
    """Make the squares of the board on the top surface narrower than high."""
    spec = read_session(folder).top_pose

    def change(image: Levels) -> Levels:
        grey = np.clip(image.mean(axis=2), 0, 255).astype(np.uint8)
        found, corners = cv2.findChessboardCornersSB(grey, spec.inner_corners)
        if not found:
            raise SystemExit(f"{folder / TOP}: no board was found")
        pixels = corners.reshape(-1, 2).astype(int)
        places = from_middle(image)[:, pixels[:, 1], pixels[:, 0]].T
        board, _ = cv2.findHomography(spec.points_mm[:, :2], places)
        back = board @ np.diag([1.0 / factor, 1.0, 1.0]) @ np.linalg.inv(board)

        def source(at: Levels) -> Levels:
            x, y, w = np.tensordot(back, np.stack([*at, np.ones_like(at[0])]), 1)
            return np.stack([x / w, y / w])

        return bent(source)(image)

    each(change, TOP)(folder)


def paler(image: Levels) -> Levels:
    """Return colours as by another colour matrix: 6 % spread over the channels."""
    return 0.94 * image + 0.06 * image.mean(axis=2, keepdims=True)


def gamma(image: Levels) -> Levels:
    """Return values as of a camera that is not linear."""
    return 255.0 * (image.clip(0.0) / 255.0) ** (1.0 / 1.1)


def blurred(image: Levels) -> Levels:
    """Return an image that is out of focus."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 3.0))


def noisier(image: Levels) -> Levels:
    """Return an image with twice its noise, which is estimated by Immerkaer's operator."""
    laplacian = cv2.filter2D(image, -1, np.outer([1, -2, 1], [1.0, -2.0, 1.0]))
    sd = np.sqrt(0.5 * np.pi) / 6.0 * np.abs(laplacian[image.max(axis=2) > 5.0]).mean()
    rng = np.random.default_rng(zlib.crc32(image.tobytes()))
    return image + np.sqrt(3.0) * sd * rng.standard_normal(image.shape)


def as_jpeg(image: Levels) -> Levels:
    """Return an image as a camera's JPEG stream of quality 40 delivers it."""
    bgr = np.clip(np.rint(image[..., ::-1]), 0, 255).astype(np.uint8)
    _, coded = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, 40])
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR)[..., ::-1], np.float64)


def cropped(image: Levels) -> Levels:
    """Return an image that the firmware crops at another place."""
    return np.roll(image, 8, 1)


def by_row(light: Callable[[Levels], Levels]) -> ImageChange:
    """Return light that changes by row, as a function of the place from top to bottom, 0..1.

    Each image has a phase of its own.
    """

    def change(image: Levels) -> Levels:
        phase = np.random.default_rng(zlib.crc32(image.tobytes())).uniform()
        return image * light(np.linspace(0.0, 1.0, len(image)) + phase)[:, None, None]

    return change


def flicker(y: Levels) -> Levels:
    """Return light that flickers by 3 %."""
    return 1.0 + 0.03 * np.sin(2.0 * np.pi * 2.7 * y)


def step(y: Levels) -> Levels:
    """Return light that becomes brighter by 3 % in mid frame."""
    return np.where(y < 1.0, 1.0, 1.03)


def denoised(image: Levels) -> Levels:
    """Return an image after the noise reduction of a camera."""
    return np.asarray(cv2.bilateralFilter(image.astype(np.float32), 9, 12.0, 3.0), np.float64)


def blended(share: float, folder: Path) -> None:
    """Blend the untouched membrane into the images of the balls."""
    untouched = read_raw_image(next((folder / BARE).glob("*.png"))).rgb
    each(lambda image: (1.0 - share) * image + share * untouched, BALLS)(folder)


def copy_ball(folder: Path) -> None:
    """Store one ball image under the name of another one, too."""
    shutil.copyfile(folder / BALLS / ODD, folder / BALLS / LIKE_ODD)


def leave_old_background(folder: Path) -> None:
    """Leave the background of an earlier calibration beside the new one."""
    old = folder / BARE / "old_00.png"
    shutil.copyfile(next((folder / BARE).glob("*.png")), old)
    change_image(old, lambda image: gain(1.05, 1.0, 0.9)(moved(4.0)(image)))


def cases() -> tuple[ChangedSession, ...]:
    """Return the changes, in the order of what a lab states, captures and has."""
    row, odd, layers, board = ChangedSession, f"{BALLS}/{ODD}", "thickness|window", "white ?board"
    gel, window = "sensor.elastomer_thickness_mm", "sensor.window_thickness_mm"
    index, led = "sensor.elastomer_refractive_index", "sensor.led_height_mm"
    on_lens, on_top = f"{LENS}.square_mm", f"{TOP}.square_mm"
    lens, dim = r"\blens\b|focus|focal|zoom", "exposure|white ?board (is|was) "
    colours, room = f"{LIGHT}|{UNMODELLED}|colou?r|white balance|crosstalk", f"{LIGHT}|room light"
    of_all, steady = "ball diameters|diameters of the balls", "moved|turned|camera"
    rolling, contrast = "row|flicker|mid frame", "blend|contrast|frame before|noise reduction"
    lift, swap = 0.005 * 255.0, {ODD: OTHER, OTHER: ODD}
    return (
        row("unchanged", "nothing", lambda _: None, "(?!)", True),
        row("ball_larger", "+10 %", balls(lambda r: {ODD: 1.1 * r[ODD]}), "ball_04"),
        row("ball_smaller", "-10 %", balls(lambda r: {ODD: 0.9 * r[ODD]}), "ball_04"),
        row("balls_larger", "+5 %", balls(lambda r: {k: 1.05 * r[k] for k in r}), of_all),
        row("balls_exchanged", "two", balls(lambda r: {k: r[swap[k]] for k in swap}), "ball_0[45]"),
        row("top_square", "+2 %", stated(lambda mm: 1.02 * mm, on_top), "square"),
        row("lens_square", "+2 %", stated(lambda mm: 1.02 * mm, on_lens), "square", True),
        row("both_squares", "+2 %", stated(lambda mm: 1.02 * mm, on_lens, on_top), "square"),
        row("board_pitch", "2.00 x 1.96 mm", partial(narrow_squares, 0.98), "square|pitch"),
        row("led_height", "+1 mm", stated(lambda mm: mm + 1.0, led), "LED height"),
        row("thickness", "+1.5 mm", stated(lambda mm: mm + 1.5, gel), layers),
        row("swollen", "gel 3 % thicker", stated(lambda mm: mm / 1.03, gel), layers, True),
        row("index", "1.46 for 1.41", stated(lambda n: n * 1.46 / 1.41, index), "refractive index"),
        row("window", "none, or one", stated(lambda mm: 0.0 if mm else 2.0, window), layers),
        row("lens_zoomed", "views 3 % smaller", each(moved(scale=0.97), LENS), lens),
        row("lens_distorted", "views, 3 % in corners", each(bent(barrel), LENS), lens),
        row("mirror_moved", "5 px", each(moved(5.0), MIRROR), "mirror"),
        row("mirror_turned", "another sensor's, 4 deg", each(moved(0.0, 4.0), MIRROR), "mirror"),
        row("mirror_colours", "BGR", each(lambda i: i[..., ::-1], MIRROR), "mirror|colou?r"),
        row("board_dim", "at 85 %", each(gain(0.85), WHITE), dim, True),
        row("board_dirty", "15 %", each(shaded(lambda x, _: 0.925 - 0.15 * x), WHITE), board, True),
        row("warm_up", "8 % over the balls", partial(warm_up, 0.08), LIGHT, True),
        row("ball_dim", "one at 90 %", each(gain(0.9), odd), f"{LIGHT}|ball_04", True),
        row("exposure", "+4 % from balls on", each(gain(1.04), *AFTER), LIGHT, True),
        row("white_balance", "red, blue", each(gain(1.05, 1.0, 0.9), *AFTER), colours, True),
        row("colour_matrix", "6 % paler from balls on", each(paler, *AFTER), colours),
        row("aperture", "-6 % in corners", each(fall_off, *AFTER), f"{colours}|lens"),
        row("room_background", "0.5 %", each(lambda image: image + lift, BARE), room),
        row("room_balls", "0.5 %", each(lambda image: image + lift, BALLS), room),
        row("gamma", "1.1", each(gamma, LENS, TOP, *LIT), f"response|gamma|{UNMODELLED}"),
        row("red_saturated", "red LED at 150 %", each(gain(1.5, 1, 1), *LIT), "saturat|exposure"),
        row("noise", "doubled", each(noisier, WHITE, *BARE_ON), "noise|average|longer", True),
        row("jpeg", "balls, quality 40", each(as_jpeg, BALLS), "compress|jpeg|png|noise"),
        row("camera_moved", "3 px from balls on", each(moved(3.0), *AFTER), steady),
        row("camera_turned", "0.3 deg from balls on", each(moved(0.0, 0.3), *AFTER), steady),
        row("cropped", "8 px after the views", each(cropped, *LIT), steady),
        row("flicker", "3 %, in all images", each(by_row(flicker), *LIT), rolling),
        row("flicker_balls", "3 %", each(by_row(flicker), BALLS), rolling),
        row("mid_frame", "+3 % in balls", each(by_row(step), BALLS), rolling),
        row("blended", "10 % of the background in balls", partial(blended, 0.1), contrast),
        row("denoised", "balls", each(denoised, BALLS), "process|noise|compress"),
        row("worn", "spot at 40 % light", each(spot(0.4), *BARE_ON), WORN, True),
        row("dots", "printed, 30 % light", each(dots(0.3), *BARE_ON), WORN, True),
        row("touched", "spot at 80 %", each(spot(0.8), BARE), "background_place|touch|lay on"),
        row("old_background", "beside the new one", leave_old_background, "old_00"),
        row("hair", "in one ball image", hair, "ball_04", True),
        row("ball_blurred", "one by 3 px", each(blurred, odd), "ball_04", True),
        row("ball_twice", "one image copied", copy_ball, "copy of"),
    )


def first_cause(calibration: gp.Calibration) -> str:
    """Return the key and the text that a user reads first, empty if all is well."""
    cause = best_cause(calibration.quality)
    if cause is not None:
        return f"{cause.key}: {cause.remedy}"
    worst = worst_of(join_quality_tables(calibration.quality.values()).figures)
    return "" if worst is None else f"{worst.key}: {worst.sentence}"


def outcome_of(case: ChangedSession, session: Path) -> dict[str, Any]:
    """Make a change, calibrate, measure the presses, and return what came out."""
    begin, presses = time.perf_counter(), list[dict[str, Any]]()
    with tempfile.TemporaryDirectory(prefix="gelpolight-changed-") as temporary:
        folder = Path(temporary) / session.name
        shutil.copytree(session, folder, ignore=shutil.ignore_patterns("truth", "truth.json"))
        case.change(folder)
        try:
            calibration = gp.calibrate(folder)
            verdict, cause = calibration.verdict.value, first_cause(calibration)
            measure = press_measurement(gp.Reconstructor(calibration))
            presses = evaluate_presses(folder / "presses", measure).rows
        except gp.InputError as error:
            verdict, cause = REFUSED, f"{REFUSED}: {error}".replace(f"{folder}/", "")
    errors = np.array([[press[f"{name}_en"] or 0.0 for name in LENGTHS] for press in presses])
    ok = np.array([press["verdict"] == "ok" for press in presses], bool)
    wrong = (errors > 1.0).any(axis=-1)
    right = verdict not in (Verdict.FAIL, REFUSED) and ok.all() and not wrong.any()
    worst = errors.max(axis=0).tolist() if errors.any() else [None] * len(LENGTHS)
    return {
        "key": case.key,
        "fault": case.fault,
        "verdict": verdict,
        "cause": cause,
        "true": re.search(case.cause, cause, re.IGNORECASE) is not None if cause else None,
        **{f"worst_{name}_over_u": en for name, en in zip(LENGTHS, worst, strict=True)},
        "ok": int(ok.sum()),
        "wrong": int(wrong.sum()),
        "silent": int((ok & wrong).sum()) if presses else 0,
        "harmless": case.harmless,
        "harmed": bool(case.harmless and not right),
        "seconds": time.perf_counter() - begin,
        "presses": presses,
    }


HEADER = (
    f"{'change':<16}{'verdict':<8}{'first':<6}{'%':>6}{'height':>7}{'size':>6}{'ok':>4}{'wrong':>6}"
    f"{'silent':>7} {'':<7}{'s':>4}  first cause (%: worst height; height, size: over U)"
)


def line(row: dict[str, Any]) -> str:
    """Return an outcome as a line of the table."""
    named = {True: "true", False: "FALSE", None: "-"}[row["true"]]
    worst = [row[f"worst_{direction}_over_u"] for direction in ("depth", "planar")]
    height, size = ("-" if en is None else f"{en:.2f}" for en in worst)
    percents = [abs(press["depth_error_percent"] or 0.0) for press in row["presses"]]
    percent = f"{max(percents):.1f}" if any(percents) else "-"
    return (
        f"{row['key']:<16}{row['verdict']:<8}{named:<6}{percent:>6}{height:>7}{size:>6}"
        f"{row['ok']:>4}"
        f"{row['wrong']:>6}{row['silent']:>7} {'HARMED' if row['harmed'] else '':<7}"
        f"{row['seconds']:>4.0f}  {row['cause']}"
    )


def summary(results: Iterable[dict[str, Any]]) -> str:
    """Return what counts, as a line."""
    rows = list(results)
    named = [row["true"] for row in rows if row["true"] is not None]
    count = {key: sum(row[key] for row in rows) for key in ("ok", "silent", "harmless", "harmed")}
    return (
        f"{len(rows)} sessions: {named.count(False)} of {len(named)} first causes are false; "
        f"{count['silent']} of {count['ok']} ok presses have a silent error; "
        f"{count['harmed']} of {count['harmless']} harmless changes harm"
    )


def main() -> None:
    """Print the table of a session."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("session", type=Path)
    parser.add_argument("out", type=Path)
    keys = [case.key for case in cases()]
    parser.add_argument("--only", nargs="+", choices=keys, default=(), metavar="KEY")
    given = parser.parse_args()
    if read_session(given.session).response is not None:
        raise SystemExit("the images of this session are not linear")
    read_truth(given.session / "presses")
    given.out.mkdir(parents=True, exist_ok=True)
    print(HEADER, flush=True)
    path = given.out / "results.json"
    kept = json.loads(path.read_text()) if given.only and path.is_file() else []
    rows = {row["key"]: row for row in kept}
    for case in cases():
        if not given.only or case.key in given.only:
            rows[case.key] = outcome_of(case, given.session)
            write_json(path, list(rows.values()))
            print(line(rows[case.key]), flush=True)
    print(summary(rows.values()))


if __name__ == "__main__":
    main()
