"""Which camera is meant, and which of its formats is best for calibration."""

from __future__ import annotations

from itertools import product

from fake_camera import C310, FORMATS

from app.sources.camera.driver import (
    UNCOMPRESSED,
    Device,
    Format,
    best_format,
    compression_warning,
    find_device,
)


def test_the_largest_uncompressed_format_with_enough_rate_is_preferred() -> None:
    assert best_format(FORMATS) == Format("YUYV", 128, 96, 7.5)


def test_the_calibrations_size_decides_before_anything_else() -> None:
    assert best_format(FORMATS, (64, 48)) == Format("YUYV", 64, 48, 30.0)
    only = (*FORMATS, Format("MJPG", 320, 240, 30.0))
    assert best_format(only, (320, 240)) == Format("MJPG", 320, 240, 30.0)


def test_compressed_formats_are_a_last_resort_with_a_warning() -> None:
    compressed = tuple(f for f in FORMATS if f.compressed)
    chosen = best_format(compressed)
    assert chosen == Format("MJPG", 128, 96, 30.0)
    assert "has only compressed images (MJPG)" in compression_warning(chosen, compressed)
    assert "Choose an uncompressed format" in compression_warning(chosen, FORMATS)
    assert compression_warning(Format("YUYV", 64, 48, 30.0), FORMATS) == ""
    assert best_format(()) is None
    assert best_format((Format("H264", 1920, 1080, 30.0),)) is None


ALL = [
    Format(*parts)
    for parts in product(
        [*UNCOMPRESSED, "MJPG", "H264"], [320, 640, 1280], [240, 480, 960], [1.0, 5.0, 7.5, 30.0]
    )
]


def test_a_camera_is_found_at_another_port_if_it_is_the_only_one_of_its_model() -> None:
    moved = Device("046d:081b@1-4:1.0", C310.name, C310.model, "/dev/video2")
    twin = Device("046d:081b@1-5:1.0", C310.name, C310.model, "/dev/video4")
    other = Device("1234:5678@x", "Other", "1234:5678", "/dev/video6")
    assert find_device((other, C310), C310.identity, C310.model) == C310
    assert find_device((other, moved), C310.identity, C310.model) == moved
    assert find_device((moved, twin), C310.identity, C310.model) is None
    assert find_device((other,), "a", "") is None
