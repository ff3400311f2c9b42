"""What the stages of a calibration are called wherever a person reads of them."""

from __future__ import annotations

from gelpolight_core.translation import tr

TITLES = {
    "lens": "Lens",
    "top_pose": "Top surface",
    "response": "Camera response",
    "lights": "Lights",
    "crosstalk": "Crosstalk",
    "radiance": "Light intensity",
    "reflectance": "Reflectance",
    "factors": "Reflectance factors",
    "joint": "Joint refinement",
}


def stage_title(key: str) -> str:
    """Return what a stage is called; a stage that is not known here goes by its key."""
    return tr(TITLES.get(key, key))
