"""Display texts of the fixed keys in results."""

from __future__ import annotations

from gelpolight_core.translation import tr


def label(key: str) -> str:
    """Return the display text of a key, such as a shape, direction or verdict.

    Unknown keys are returned unchanged.
    """
    labels = {
        "all": tr("all"),
        "planar": tr("planar"),
        "depth": tr("depth"),
        "same region": tr("same region"),
        "random regions": tr("random regions"),
        "cylinder": tr("cylinder"),
        "cuboid": tr("cuboid"),
        "ball": tr("ball"),
        "ok": tr("ok"),
        "doubtful": tr("doubtful"),
        "not measured": tr("not measured"),
        "conforms": tr("conforms"),
        "not decidable": tr("not decidable"),
        "does not conform": tr("does not conform"),
        "diameter": tr("diameter"),
        "side": tr("side"),
        "height": tr("height"),
        "noise": tr("noise"),
        "calibration": tr("calibration"),
        "model": tr("model and mode"),
        "fit": tr("fit"),
        "reference": tr("reference"),
        "reflectance": tr("reflectance"),
        "background": tr("background"),
        "spherical_cap": tr("spherical cap"),
        "height_field": tr("height field"),
        "two-lobe": tr("two-lobe"),
        "one-dimensional": tr("one-dimensional"),
        "red": tr("red"),
        "green": tr("green"),
        "blue": tr("blue"),
    }
    return labels.get(key, key)
