"""What a preset of a closed sensor states is checked, or a message says that it is not."""

import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.closed_sensor.preset import FOLDER, preset_named, presets


def test_the_sensors_people_own_have_presets():
    assert set(presets()) == {"9dtact", "digit", "gelsight-mini"}


@pytest.mark.parametrize("key", presets())
def test_the_image_shows_about_the_working_area(key):
    preset = preset_named(key)
    for pixels, mm in zip(preset.image_px, preset.working_area_mm, strict=True):
        assert pixels * preset.mm_per_px == pytest.approx(mm, rel=0.15)


def test_a_sensor_whose_lights_show_no_slope_is_named():
    assert preset_named("9dtact").limits and not preset_named("digit").limits


@pytest.mark.parametrize(
    ("line", "key"),
    [
        ("mm_per_px = 0.0634", "[image] mm_per_px"),
        ("cropped = [0.143, 0.143, 0.143, 0.143]", "[camera] cropped"),
        ("light_colours = 3", "light_colours"),
    ],
)
def test_a_preset_of_ones_own_is_checked(tmp_path, line, key):
    own = tmp_path / "own.toml"
    text = (FOLDER / "gelsight-mini.toml").read_text()
    own.write_text(text)
    assert preset_named(str(own)) == preset_named("gelsight-mini")
    own.write_text(text.replace(line, f'{line.split(" = ")[0]} = ["x"]'))
    with pytest.raises(InputError) as refused:
        preset_named(str(own))
    assert key in refused.value.found
    with pytest.raises(InputError, match="no preset"):
        preset_named("gelsite")
