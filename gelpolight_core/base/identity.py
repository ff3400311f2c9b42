"""Texts from which identities are made: they stay when a class gets another name."""

import re

_EARLIER = {
    "CameraModel": "Camera",
    "ClosedSensorSettings": "InPlace",
    "MembraneBrdf": "Membrane",
    "MembraneShape": "Surface",
    "ScaleReference": "PressedScale",
}
"""Names of classes when the first identities were stored, by their present names."""
_CLASS = re.compile(rf"\b({'|'.join(_EARLIER)})\(")


def identity_text(value: object) -> str:
    """Return the text of a value in stored identities.

    Examples
    --------
    >>> identity_text(("A-001", 2.0))
    "('A-001', 2.0)"
    """
    return _CLASS.sub(lambda found: f"{_EARLIER[found[1]]}(", repr(value))
