"""Names of the calibration stages shown to users."""

from __future__ import annotations

from gelpolight_core.translation import tr


def stage_title(key: str) -> str:
    """Return the name of a stage; an unknown stage is shown by its key."""
    titles = {
        "lens": tr("Lens"),
        "top_pose": tr("Top surface"),
        "response": tr("Camera response"),
        "lights": tr("Lights"),
        "crosstalk": tr("Crosstalk"),
        "radiance": tr("Light intensity"),
        "background": tr("Background"),
        "balls": tr("Ball presses"),
        "reflectance": tr("Reflectance"),
        "factors": tr("Reflectance factors"),
        "joint": tr("Joint refinement"),
        "scale": tr("Scale"),
        "in_place": tr("Slopes of presses left out"),
        "gel": tr("Gel change"),
    }
    return titles.get(key, key)
