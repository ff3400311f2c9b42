"""The virtual sensor delivers every state like a camera, with the camera's noise."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from app.sources.rendering import state_of
from app.sources.source import SourceFrame
from app.sources.virtual_bench import ITEMS, VirtualBench
from app.sources.virtual_source import VirtualSource
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.virtual_sensor import VirtualSensor, Whiteboard

WAIT_S = 300.0


def design_without_noise(design: SensorDesign) -> SensorDesign:
    return replace(design, camera=replace(design.camera, shot_variance=0.0, read_sd=0.0))


def settled(source: VirtualSource) -> SourceFrame:
    """Return the first frame that shows the scene on the bench."""
    limit = time.monotonic() + WAIT_S
    while time.monotonic() < limit:
        frame = source.frame(0.2)
        if frame is not None and frame.settled:
            return frame
    raise AssertionError("the virtual sensor did not come to rest")


@pytest.fixture
def source(bench):
    bench.set_conditions(rate_hz=60.0)
    source = VirtualSource(bench)
    source.open()
    yield source
    source.close()


def test_without_noise_each_state_equals_the_virtual_sensor_image(source):
    bench = source.bench
    bench.set_conditions(noise=0.0)
    sensor = VirtualSensor(design_without_noise(bench.design), bench.seed)
    for item in ITEMS:
        bench.place_object(item)
        bench.set_scene(size_mm=3.0)
        expected = sensor.frame(state_of(bench, bench.scene))
        # The source keeps float32: values half-way between two counts may be rounded another way.
        away = np.abs(settled(source).rgb.astype(int) - expected)
        assert away.max() <= 1 and away.mean() < 1e-4, item
    bench.show("whiteboard")  # as in a simulated session
    assert np.array_equal(settled(source).rgb, sensor.frame(Whiteboard()))


def test_no_two_captures_are_alike_even_after_opening_again(source):
    first = settled(source)
    source.close()
    source.open()
    images = [first.rgb, settled(source).rgb, settled(source).rgb]
    assert len({image.tobytes() for image in images}) == 3


def test_exposure_gain_and_faults_change_the_image_as_in_a_camera(source):
    source.bench.set_conditions(noise=0.0)
    usual = settled(source).rgb.astype(float)
    source.bench.set_conditions(exposure_ms=5.0)
    half = settled(source).rgb.astype(float)
    assert np.abs(half - 0.5 * usual).max() <= 1.0
    source.bench.set_conditions(exposure_ms=10.0, gain_db=6.0)
    factor = 10.0 ** (6.0 / 20.0)
    double = settled(source).rgb.astype(float)
    assert np.abs(double - np.minimum(255.0, factor * usual)).max() <= 0.5 * factor + 0.5
    source.bench.set_conditions(gain_db=24.0)
    bright = settled(source).rgb
    assert bright.max() == 255
    assert (bright == 255).mean() > 0.1
    # The light of a dead LED is missing in every channel.
    source.bench.set_conditions(gain_db=0.0)
    source.bench.place_object("whiteboard")
    lit = settled(source).rgb.astype(float)
    source.bench.switch("led_off", True)
    dead = settled(source).rgb.astype(float)
    mixed = np.array(source.bench.design.photometry.crosstalk)
    before, seen = (np.linalg.solve(mixed, rgb.reshape(-1, 3).mean(axis=0)) for rgb in (lit, dead))
    assert seen[2] == pytest.approx(0.0, abs=0.01 * before[2] + 0.5)
    assert seen[:2] == pytest.approx(before[:2], abs=1.0)
    # A defocused lens widens edges and keeps the light.
    source.bench.switch("led_off", False)
    source.bench.place_object("checkerboard")
    sharp = settled(source).rgb.astype(float)
    source.bench.switch("defocused", True)
    soft = settled(source).rgb.astype(float)
    steepest = [np.abs(np.diff(image[..., 1], axis=1)).max() for image in (sharp, soft)]
    assert steepest[1] < 0.4 * steepest[0]
    assert soft.mean() == pytest.approx(sharp.mean(), rel=0.02)


def test_closing_does_not_wait_for_a_slow_image():
    source = VirtualSource(VirtualBench())
    source.bench.place_object("coin")
    source.open()
    source.frame(0.5)  # the coin press is being computed
    source.close()  # waits for a second, and leaves behind what has not ended then
    assert not any(thread.name == "virtual sensor" for thread in threading.enumerate())


def test_a_frame_that_was_never_rendered_is_not_lost(source):
    first = settled(source)
    time.sleep(0.3)  # nobody reads it meanwhile
    assert settled(source).number == first.number + 1
