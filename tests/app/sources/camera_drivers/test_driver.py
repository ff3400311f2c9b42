"""Which camera is meant, and which of its formats is best for calibration."""

from fake_camera import FORMATS

from app.sources.camera_drivers.driver import (
    CameraDevice,
    CameraFormat,
    best_format,
    compression_warning,
    find_device,
    has_placeholder,
    without_port,
)


def test_the_largest_uncompressed_format_with_enough_rate_is_preferred():
    assert best_format(FORMATS) == CameraFormat("YUYV", 128, 96, 7.5)


def test_compressed_formats_are_a_last_resort_with_a_warning():
    compressed = tuple(f for f in FORMATS if f.compressed)
    chosen = best_format(compressed)
    assert chosen == CameraFormat("MJPG", 128, 96, 30.0)
    assert "has only compressed images (MJPG)" in compression_warning(chosen, compressed)
    assert "Choose an uncompressed format" in compression_warning(chosen, FORMATS)
    assert compression_warning(CameraFormat("YUYV", 64, 48, 30.0), FORMATS) == ""
    assert best_format(()) is None
    assert best_format((CameraFormat("H264", 1920, 1080, 30.0),)) is None


def test_a_camera_is_found_at_another_port_by_its_serial_number():
    def same(one: str, other: str) -> bool:
        return without_port(one) == without_port(other)

    def device(identity: str) -> CameraDevice:
        return CameraDevice(identity, "Camera", "046d:081b", "/dev/video0")

    here, there, third = (device(f"046d:081b@SN1/1.0 at 1-{port}") for port in (2, 3, 4))
    other = device("046d:081b@1-5:1.0")
    assert find_device((other, there, here), here.identity, same) == here
    assert find_device((other, there), here.identity, same) == there
    assert find_device((there, third), here.identity, same) is None
    assert find_device((device("046d:081b@1-6:1.0"),), other.identity, same) is None


PLACEHOLDERS = "200901010001", "SN0001", "0000000000", "0123456789", "12345678", "1", "none"
NUMBERS = "3F2A9C10", "SN0002", "28GH-EJZ8", "D20235", "200901010002", "200904170001", "2019010112"


def test_a_serial_number_that_makers_give_to_every_camera_is_known():
    def identity(serial: str) -> str:
        return f"046d:081b@{serial}/1.0 at 1-2"

    assert [one for one in PLACEHOLDERS if not has_placeholder(identity(one))] == []
    assert [one for one in NUMBERS if has_placeholder(identity(one))] == []
    assert not has_placeholder("046d:081b@1-1:1.0")  # a port alone
