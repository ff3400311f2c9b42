"""Session folders are read correctly, and every mistake is reported with its file and key."""

import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.image_checks import refuse_copies
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.session.description import write_description
from gelpolight_core.session.inventory import StoredImage
from gelpolight_core.session.session import ClosedSensorSettings, read_session
from gelpolight_core.session.session_images import read_linear_image, require_colour

GOOD = """format = "gelpolight-session"
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
[top_pose]
inner_corners = [7, 5]
square_mm = 2.0
[balls]
default_radius_mm = 3.0
[balls.radius_mm]
"ball_03.png" = 4.0
"""


def session_folder(folder: Path, text: str = GOOD) -> Path:
    """Write a session.toml and return its folder."""
    folder.mkdir(exist_ok=True)
    (folder / "session.toml").write_text(text)
    return folder


def test_a_good_description_is_read_with_its_defaults(tmp_path):
    session = read_session(session_folder(tmp_path))
    assert session.sensor.led_height_mm == 13.8
    assert session.sensor.window_thickness_mm == 0.0
    assert session.checkerboard.inner_corners == (9, 6)
    assert session.top_pose.square_mm == 2.0
    assert session.ball_radius_mm("ball_00.png") == 3.0
    assert session.ball_radius_mm("ball_03.png") == 4.0


def test_radii_of_older_descriptions_are_read_and_written_with_their_unit(tmp_path):
    new = read_session(session_folder(tmp_path))
    older = GOOD.replace("default_radius_mm", "default").replace("[balls.radius_mm]\n", "")
    session = read_session(session_folder(tmp_path, older))
    assert session == new
    write_description(session)
    balls = tomllib.loads((tmp_path / "session.toml").read_text())["balls"]
    assert balls == {"default_radius_mm": 3.0, "radius_mm": {"ball_03.png": 4.0}}
    assert read_session(tmp_path) == new


@pytest.mark.parametrize("stated, degrees", [("", None), ("led_half_angle_deg = 50\n", 50.0)])
def test_the_half_angle_of_the_leds_is_optional_and_kept(tmp_path, stated, degrees):
    text = GOOD.replace("elastomer_thickness", f"{stated}elastomer_thickness")
    session = read_session(session_folder(tmp_path, text))
    assert session.sensor.led_half_angle_deg == degrees
    write_description(session)
    assert read_session(tmp_path) == session


@pytest.mark.parametrize(
    ("stated", "expected"),
    [
        ("", None),
        ("[whiteboard]\nreflectance = 0.88\n", (0.88, 0.88, 0.88)),
        ("[whiteboard]\nreflectance = [0.86, 0.88, 0.9]\n", (0.86, 0.88, 0.9)),
    ],
)
def test_the_reflectance_of_the_white_board_is_one_number_or_one_for_each_channel(
    tmp_path, stated, expected
):
    session = read_session(session_folder(tmp_path, GOOD + stated))
    assert session.board_reflectance == expected
    write_description(session)
    assert read_session(tmp_path) == session
    written = tomllib.loads((tmp_path / "session.toml").read_text()).get("whiteboard")
    assert written == (expected and {"reflectance": list(expected)})


def test_the_top_pose_uses_the_same_board_when_none_is_named(tmp_path):
    text = GOOD.replace("[top_pose]\ninner_corners = [7, 5]\nsquare_mm = 2.0\n", "")
    session = read_session(session_folder(tmp_path, text))
    assert session.top_pose == session.checkerboard


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("version = 1", "version = 2", "reads up to version 1"),
        ("gelpolight-session", "other", "format"),
        ("led_height_mm = 13.8", "", r"led_height_mm is missing"),
        ("led_height_mm = 13.8", "led_height_mm = nan", "led_height_mm is nan"),
        ("led_height_mm = 13.8", "led_height_mm = 1" + "0" * 400, "not a number from"),
        ("[checkerboard]", "led_half_angle_deg = 9\n[checkerboard]", "from 10 to 85"),
        ("[checkerboard]", "led_half_angle_deg = 120\n[checkerboard]", "led_half_angle_deg is 120"),
        ("[balls]", "[whiteboard]\nreflectance = 92\n[balls]", "reflectance.* is 92"),
        ("[balls]", "[whiteboard]\nreflectance = 0.1\n[balls]", "from 0.3 to 1"),
        ("[balls]", "[whiteboard]\nreflectance = [0.9, 0.9]\n[balls]", "reflectance"),
        ("[balls]", "[whiteboard]\nreflectance = 'white'\n[balls]", "reflectance"),
        ("[balls]", "[whiteboard]\ncolour = 0.9\n[balls]", "colour"),
        ("index = 1.41", "index = 2.6", "refractive_index is 2.6"),
        ("[sensor]", "a = " + "[" * 3000 + "]" * 3000 + "\n[sensor]", "nested too deeply"),
        ("led_height_mm = 13.8", 'led_height_mm = "13.8"', 'led_height_mm is "13.8", not a number'),
        ("working_diameter_mm = 26.0", "working_diameter_mm = 26.0\nfoo = 1", r"\[sensor\] foo"),
        ("[balls]", "[colours]\nx = 1\n[balls]", "colours"),
        ("inner_corners = [9, 6]", "inner_corners = [9]", "inner_corners"),
        ("default_radius_mm = 3.0", "default_radius_mm = 0", r"\[balls\] default_radius_mm is 0"),
        ("default_radius_mm = 3.0", "default = 0", r"\[balls\] default is 0"),
        ("default_radius_mm = 3.0", "default_radius_mm = 3.0\ndefault = 3.0", "stated twice"),
        ("[balls.radius_mm]\n", "radius_mm = 3.0\n[balls.other]\n", "radius_mm is not a table"),
        ("[sensor]", "[sensor", "TOML"),
    ],
)
def test_every_mistake_in_session_toml_is_named(tmp_path, old, new, what):
    with pytest.raises(InputError, match=what) as refusal:
        read_session(session_folder(tmp_path, GOOD.replace(old, new, 1)))
    assert "session.toml" in refusal.value.where


def test_a_folder_without_a_session_and_a_stage_without_images_are_named(tmp_path):
    with pytest.raises(InputError, match=r"session\.toml"):
        read_session(tmp_path)
    session = read_session(session_folder(tmp_path))
    with pytest.raises(InputError, match="no images") as refusal:
        session.files("mirror")
    assert refusal.value.where.endswith("mirror")


def test_a_ball_without_a_radius_is_named(tmp_path):
    session = read_session(session_folder(tmp_path, GOOD.replace("default_radius_mm = 3.0\n", "")))
    with pytest.raises(InputError, match=r"ball_00\.png"):
        session.ball_radius_mm("ball_00.png")


def test_a_misspelt_ball_is_not_given_the_default_radius(tmp_path):
    """ball_3.png = 4.0 was meant for ball_03.png; at the default 3.0 the sensor would be wrong."""
    text = GOOD.replace("ball_03.png", "ball_3.png")
    session = read_session(session_folder(tmp_path, text))
    (tmp_path / "balls").mkdir()
    (tmp_path / "balls" / "ball_03.png").touch()
    with pytest.raises(
        InputError, match=r"ball_3\.png, which does not exist, but not ball_03\.png"
    ):
        session.ball_radius_mm("ball_03.png")


def test_a_description_from_an_editor_that_marks_utf8_is_read(tmp_path):
    folder = session_folder(tmp_path)
    (folder / "session.toml").write_bytes(b"\xef\xbb\xbf" + GOOD.encode())
    assert read_session(folder).sensor.serial == "A-001"


def test_a_copied_image_is_refused_and_both_files_named(tmp_path):
    """A background copied to the whiteboard gives a calibration that looks good."""
    files = [tmp_path / stage / "p.png" for stage in ("mirror", "whiteboard", "background")]
    for number, path in enumerate(files):
        path.parent.mkdir()
        path.write_bytes(bytes([number]))
    refuse_copies(map(StoredImage.of, files))
    files[2].write_bytes(files[1].read_bytes())
    with pytest.raises(InputError, match=r"copy of whiteboard/p\.png") as refusal:
        refuse_copies(map(StoredImage.of, files))
    assert refusal.value.where == str(files[2])


def write_rgb(path: Path, rgb: np.ndarray) -> None:
    """Write an RGB image, converted to the colour order of OpenCV."""
    assert cv2.imwrite(str(path), np.ascontiguousarray(rgb[..., ::-1]))


@pytest.mark.parametrize(("kind", "top", "ending"), [("u1", 255, "png"), ("u2", 65535, "tif")])
def test_images_are_red_first_and_linear(tmp_path, kind, top, ending):
    rgb = np.zeros((4, 5, 3), kind)
    rgb[0, 0] = [top, top // 3, 0]
    write_rgb(tmp_path / f"p.{ending}", rgb)
    image = read_linear_image(tmp_path / f"p.{ending}")
    np.testing.assert_allclose(image.rgb[0, 0], [1.0, 1 / 3, 0.0], atol=1e-6)
    assert image.size == (5, 4)
    assert image.bit_depth == (8 if top == 255 else 16)


def test_frames_of_one_view_are_averaged_and_sizes_must_agree(tmp_path):
    session_folder(tmp_path)
    (tmp_path / "mirror").mkdir()
    for n, value in enumerate((100, 102)):
        write_rgb(tmp_path / f"mirror/{n}.png", np.full((4, 5, 3), value, np.uint8))
    mean = read_session(tmp_path).averaged("mirror")
    assert mean.rgb[0, 0, 0] == pytest.approx(101 / 255)
    assert mean.frame_count == 2
    write_rgb(tmp_path / "mirror/3.png", np.zeros((4, 6, 3), np.uint8))
    with pytest.raises(InputError, match=r"6x4.*5x4"):
        read_session(tmp_path).averaged("mirror")


def test_a_grey_image_is_refused_where_colour_is_needed():
    with pytest.raises(InputError, match="grey"):
        require_colour(LinearImage("g", np.full((2, 2, 3), 0.5, np.float32)), where="g")
    with pytest.raises(InputError, match="saturated"):
        require_colour(LinearImage("w", np.ones((2, 2, 3), np.float32)), where="w")
    require_colour(LinearImage("c", np.float32([[[0.5, 0.1, 0.2]]])), where="c")


CLOSED = """format = "gelpolight-session"
version = 1
[sensor]
serial = "c-1"
[in_place]
mm_per_px = [0.06, 0.05]
region_px = [20, 10, 200, 150]
[balls]
default = 3.0
"""


def test_a_closed_sensor_states_scale_and_region(tmp_path):
    session = read_session(session_folder(tmp_path, CLOSED))
    assert session.serial == "c-1"
    assert session.in_place == ClosedSensorSettings((0.06, 0.05), region_px=(20, 10, 200, 150))
    write_description(session)
    assert read_session(tmp_path) == session
    square = CLOSED.replace("[0.06, 0.05]", "0.06")
    written = read_session(session_folder(tmp_path, square))
    assert written.in_place is not None and written.in_place.mm_per_px == (0.06, 0.06)
    write_description(written)
    assert "mm_per_px = 0.06\n" in (tmp_path / "session.toml").read_text()


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("[0.06, 0.05]", "[0.06, 0.05, 0.04]", "mm_per_px"),
        ("200, 150", "200", r"\[in_place\] region_px has 3 entries, not 4"),
        ("200, 150", "0, 150", r"\[in_place\] region_px\[2\] is 0"),
        ("mm_per_px = [0.06, 0.05]\n", "", "has no mm_per_px"),
        ('serial = "c-1"', 'serial = "c-1"\nled_height_mm = 13.0', "led_height_mm"),
    ],
)
def test_a_wrong_key_of_a_closed_sensor_is_named(tmp_path, old, new, match):
    with pytest.raises(InputError, match=match):
        read_session(session_folder(tmp_path, CLOSED.replace(old, new, 1)))
