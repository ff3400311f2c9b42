"""Optional stages of a session are read and checked."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.session.session import Session, read_session
from gelpolight_core.session.session_images import read_linear_image

TEXT = """format = "gelpolight-session"
version = 1
[sensor]
serial = "A-001"
led_height_mm = 13.8
elastomer_thickness_mm = 14.0
elastomer_refractive_index = 1.41
working_diameter_mm = 26.0
[checkerboard]
inner_corners = [9, 6]
square_mm = 3.0
[balls]
default = 3.0
"""


def session_of(folder: Path, more: str = "", *images: str) -> Session:
    """Return a session with additions to its description, and with small images."""
    (folder / "session.toml").write_text(TEXT + more)
    for number, name in enumerate(images):
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        assert cv2.imwrite(str(path), np.full((4, 6, 3), 40 * number + 20, np.uint8))
    return read_session(folder)


def test_a_session_that_declares_nothing_is_read_as_linear(tmp_path):
    session = session_of(tmp_path, "", "mirror/m.png")
    assert session.declared_response is None
    assert session.response is None
    assert session.optional_stages == ()
    assert session.averaged("mirror").rgb[0, 0, 0] == np.float32(20.0 / 255.0)


@pytest.mark.parametrize(
    ("camera", "declared", "light"),
    [
        ('response = "srgb"', "srgb", ((20 / 255 + 0.055) / 1.055) ** 2.4),
        ("gamma = 2.2", 2.2, (20 / 255) ** 2.2),
        ("gamma = 2", 2.0, (20 / 255) ** 2),
    ],
)
def test_a_declared_response_is_undone_in_every_stage(tmp_path, camera, declared, light):
    session = session_of(tmp_path, f"[camera]\n{camera}\n", "mirror/m.png")
    assert session.declared_response == declared
    assert session.averaged("mirror").rgb == pytest.approx(light, abs=1e-6)
    # The file itself is read unchanged.
    assert read_linear_image(tmp_path / "mirror" / "m.png").rgb == pytest.approx(20 / 255)


@pytest.mark.parametrize(
    ("more", "what"),
    [
        ('[camera]\nresponse = "srgb"\ngamma = 2.2\n', "cannot be combined with a gamma"),
        ('[camera]\nresponse = "log"\n', 'response is "log", not one of linear, srgb'),
        ("[camera]\nresponse = 2.2\n", "response is 2.2, not one of"),
        ("[camera]\ngamma = 0\n", "gamma is 0"),
        ('[camera]\ngamma = "2.2"\n', "gamma"),
        ("[camera]\n", "response is missing"),
        ("[camera]\ngain = 2\n", r"\[camera\] gain is unknown"),
        ('[response]\n"a.png" = -1\n', "a.png is -1"),
    ],
)
def test_a_contradictory_or_misspelt_declaration_is_named(tmp_path, more, what):
    with pytest.raises(InputError, match=what):
        session_of(tmp_path, more)


def test_a_series_is_read_as_the_camera_encoded_it_with_its_times(tmp_path):
    more = '[camera]\ngamma = 2.2\n[response]\n"b.png" = 4.0\n"a.png" = 1\n'
    session = session_of(tmp_path, more, "response/a.png", "response/b.png")
    images, times = session.series()
    assert session.optional_stages == ("response",)
    assert times == (1.0, 4.0)
    assert [p.rgb[0, 0, 0] for p in images] == pytest.approx([20 / 255, 60 / 255])


@pytest.mark.parametrize(
    ("more", "images", "what"),
    [
        ("", ("a.png",), "no exposure time in ms for a.png"),
        ('[response]\n"a.png" = 1.0\n', ("a.png", "b.png"), "no exposure time in ms for b.png"),
        ('[response]\n"a.png" = 1.0\n"c.png" = 2.0\n', ("a.png",), "lists c.png"),
        ('[response]\n"a.png" = 1.0\n', (), "no images"),
    ],
)
def test_a_series_whose_times_do_not_fit_is_refused(tmp_path, more, images, what):
    session = session_of(tmp_path, more, *(f"response/{name}" for name in images))
    assert session.optional_stages == ("response",)
    with pytest.raises(InputError, match=what):
        session.series()


def test_single_led_images_are_ordered_red_green_blue(tmp_path):
    names = ("single_led/blue.png", "single_led/green.tif", "single_led/red.png")
    session = session_of(tmp_path, "", *names)
    assert session.optional_stages == ("single_led",)
    assert [p.name for p in session.single_led()] == ["red.png", "green.tif", "blue.png"]
