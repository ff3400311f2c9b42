"""Display texts of the fixed keys in results."""

from __future__ import annotations


def label(key: str) -> str:
    """Return the display text of a key, such as a shape, direction or verdict.

    Unknown keys are returned unchanged.
    """
    labels = {
        "all": "all",
        "planar": "planar",
        "depth": "depth",
        "cylinder": "cylinder",
        "cuboid": "cuboid",
        "ball": "ball",
        "ok": "ok",
        "doubtful": "doubtful",
        "not measured": "not measured",
        "conforms": "conforms",
        "not decidable": "not decidable",
        "does not conform": "does not conform",
        "diameter": "diameter",
        "side": "side",
        "height": "height",
        "noise": "noise",
        "calibration": "calibration",
        "model": "model and mode",
        "fit": "fit",
        "reference": "reference",
        "reflectance": "reflectance",
        "background": "background",
        "spherical_cap": "spherical cap",
        "height_field": "height field",
        "two-lobe": "two-lobe",
        "one-dimensional": "one-dimensional",
        "red": "red",
        "green": "green",
        "blue": "blue",
    }
    return labels.get(key, key)
