"""Identities stay when a class gets another name."""

from gelpolight_core.base.identity import identity_text
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.session.session import ClosedSensorSettings


def test_a_class_with_another_name_keeps_its_text_in_stored_identities():
    camera = CameraModel(640, 480, 600.0, 600.0, 320.0, 240.0)
    closed = ClosedSensorSettings(0.05)

    text = identity_text((camera, "CameraModel", closed))

    assert text.startswith("(Camera(width=640, height=480, fx=600.0")
    assert ", 'CameraModel', InPlace(mm_per_px=0.05" in text
