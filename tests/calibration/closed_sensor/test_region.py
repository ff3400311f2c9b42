"""Images in which the membrane is only a part, and cameras whose pixels are not square."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Verdict
from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
from gelpolight_core.calibration.closed_sensor_recipe import BALLS
from gelpolight_core.calibration.project import run_calibration
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.session import Session, read_session
from tests.calibration.closed_sensor.conftest import few

Image = NDArray[Any]
LEFT, TOP, RIGHT, BOTTOM = 60, 9, 12, 35
"""Widths of the housing around the membrane: its middle is not that of the image."""


def in_housing(image: Image) -> Image:
    """Return an image with a housing around it that mirrors the membrane."""
    return cv2.copyMakeBorder(image, TOP, BOTTOM, LEFT, RIGHT, cv2.BORDER_REFLECT)


def changed(folder: Path, into: Path, change: Callable[[Image], Image], stated: str) -> Session:
    """Return a copy of a session with all images changed and `stated` in [in_place]."""
    shutil.copytree(folder, into)
    for path in [*(into / "background").iterdir(), *(into / "balls").iterdir()]:
        assert cv2.imwrite(str(path), change(cv2.imread(str(path), cv2.IMREAD_UNCHANGED)))
    text = (into / "session.toml").read_text()
    lines = [line for line in text.splitlines() if not line.startswith("mm_per_px")]
    (into / "session.toml").write_text(
        "\n".join(lines).replace("[in_place]", f"[in_place]\n{stated}") + "\n"
    )
    return read_session(into)


def scale_of(session: Session) -> float:
    """Return the stated size of a pixel on the membrane."""
    assert session.in_place is not None and isinstance(session.in_place.stated_scale, float)
    return session.in_place.stated_scale


@pytest.fixture(scope="module")
def housed_session(closed_folder, closed_session, tmp_path_factory):
    """Return the closed sensor's session with a housing around the membrane."""
    width, height = closed_session.averaged("background").size
    stated = f"mm_per_px = {scale_of(closed_session)}\nmm_per_px_sd = 0.0001\n"
    stated += f"region_px = [{LEFT}, {TOP}, {width}, {height}]"
    into = tmp_path_factory.mktemp("housed") / "session"
    return changed(closed_folder, into, in_housing, stated)


@pytest.mark.function("State the membrane's region of a closed sensor's images")
def test_a_region_gives_the_depth_of_the_membrane_alone_at_the_places_of_the_whole_image(
    housed_session, closed_run, closed_session, tmp_path
):
    run = run_calibration(housed_session)
    path = tmp_path / "housed.gplcal"
    write_calibration(run.calibration, path)
    calibration = read_calibration(path)
    assert calibration.identity == run.calibration.identity != closed_run.calibration.identity
    name = run.results[BALLS].result.presses[0].name
    whole = housed_session.image(housed_session.folder / "balls" / name).rgb
    alone = closed_session.image(closed_session.folder / "balls" / name).rgb
    found = Reconstructor(calibration).depth(whole)
    wanted = Reconstructor(closed_run.calibration).depth(alone)
    assert np.array_equal(found.depth_mm, wanted.depth_mm)
    # The middle of the membrane is this far from the middle of the image, in pixels.
    shift = 0.5 * np.array([LEFT - RIGHT, TOP - BOTTOM]) * scale_of(closed_session)
    assert found.x_mm == pytest.approx(wanted.x_mm + shift[0], abs=1e-6)
    assert found.y_mm == pytest.approx(wanted.y_mm + shift[1], abs=1e-6)
    table = calibration.table
    assert (table.u_px[0, 0], table.v_px[0, 0]) == pytest.approx((LEFT, TOP), abs=1e-3)
    ball = run.results[BALLS].result.presses[0].ball
    place = np.array([run.calibration.data.balls[0][1:3]])
    assert calibration.data.to_pixels(place)[0] == pytest.approx((ball.x + LEFT, ball.y + TOP))


def test_a_region_beyond_the_image_is_refused(housed_session):
    assert housed_session.in_place is not None
    beyond = replace(housed_session.in_place, region_px=(LEFT, TOP, 10_000, 60))
    with pytest.raises(InputError, match="is not inside the image"):
        run_calibration(replace(housed_session, in_place=beyond))


@pytest.fixture(scope="module")
def squeezed_session(closed_folder, closed_session, tmp_path_factory):
    """Return the closed sensor's session as a camera with fewer rows of taller pixels sees it."""
    width, height = closed_session.averaged("background").size

    def squeeze(image: Image) -> Image:
        return cv2.resize(image, (width, height * 4 // 5), interpolation=cv2.INTER_AREA)

    scale = scale_of(closed_session)
    stated = f"mm_per_px = [{scale}, {1.25 * scale}]\nmm_per_px_sd = 0.0001"
    return changed(closed_folder, tmp_path_factory.mktemp("tall") / "session", squeeze, stated)


@pytest.mark.function("State pixels that are not square")
def test_pixels_that_are_not_square_give_a_metric_map(squeezed_session, closed_run, tmp_path):
    run = run_calibration(few(squeezed_session))
    path = tmp_path / "tall.gplcal"
    write_calibration(run.calibration, path)
    name = run.results[BALLS].result.presses[0].name
    image = squeezed_session.image(squeezed_session.folder / "balls" / name).rgb
    found = Reconstructor(read_calibration(path)).depth(image)
    assert np.diff(found.y_mm) == pytest.approx(np.diff(found.x_mm)[0])
    assert found.depth_mm.shape == closed_run.results[BALLS].result.model.grid.shape
    for (_, *ball), (_, *wanted) in zip(
        run.calibration.data.balls, closed_run.calibration.data.balls[:5], strict=True
    ):
        assert ball == pytest.approx(wanted, abs=0.15)
    ratios = [press.held_out.diameter_ratio for press in run.results[BALLS].result.presses]
    assert np.median(ratios) == pytest.approx(1.0, abs=0.03)


@pytest.mark.function("Learn from the contacts that pixels are not square")
def test_contacts_that_are_all_oval_alike_say_what_pixels_to_state(
    squeezed_session, closed_run, closed_session
):
    assert squeezed_session.in_place is not None
    scale = scale_of(closed_session)
    nearly = replace(squeezed_session.in_place, mm_per_px=(scale, 1.15 * scale))
    run = run_calibration(replace(few(squeezed_session), in_place=nearly))
    figures = {f.key: f for f in run.calibration.quality["scale"].figures}
    oval = figures["contact_stretch_percent"]
    assert oval.verdict is Verdict.WARN
    assert oval.value == pytest.approx(100.0 * np.log(1.25 / 1.15), abs=1.5)
    stated = [float(n) for n in oval.remedy.split("[")[1].rstrip("]").split(",")]
    assert stated == pytest.approx([scale, 1.25 * scale], rel=0.015)
    usual = {f.key: f for f in closed_run.calibration.quality["scale"].figures}
    assert usual["contact_stretch_percent"].verdict is Verdict.PASS


@pytest.mark.function("Learn that a channel has no light in any image of a closed sensor")
@pytest.mark.parametrize("share", [0.0, 0.05])
def test_a_channel_without_light_in_all_images_is_named(
    closed_folder, closed_session, tmp_path, share
):
    random = np.random.default_rng(1)

    def without_blue(image: Image) -> Image:
        level = 1 if image.dtype == np.uint8 else 256
        noise = random.normal(1.0, 1.0, image.shape[:2]) * level
        blue = share * image[..., 2] + noise  # OpenCV's order: blue, green, red
        image[..., 0] = np.maximum(blue, 0).round()
        return image

    stated = f"mm_per_px = {scale_of(closed_session)}"
    session = changed(closed_folder, tmp_path / "session", without_blue, stated)
    with pytest.raises(InputError, match="The blue channel shows no light of its own"):
        run_calibration(session)
