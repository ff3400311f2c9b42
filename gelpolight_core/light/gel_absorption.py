"""Absorption in the gel: Beer and Lambert's law for each colour."""

from __future__ import annotations

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.channels import CHANNEL_KEYS

from .light_term import LightTerm
from .parameter import Parameter, Prior, PriorSource


def _loss_per_mm(values: Float64Array) -> Float64Array:
    """Return the loss along the path, (3,)."""
    return values


_CLEAR = Prior(0.002, 0.003, PriorSource.USUAL_GEL)
ABSORPTION = LightTerm(
    "absorption",
    "absorption of the gel",
    parameters=tuple(
        Parameter(
            "absorption_per_mm",
            f"absorption of {name} light",
            0.002,
            (0.0, 0.05),
            _CLEAR,
            typical_change=0.002,
            channel=k,
            figure=f"Absorption of the gel, {name}",
            unit="per mm",
        )
        for k, name in enumerate(CHANNEL_KEYS)
    ),
    loss_per_mm=_loss_per_mm,
)
"""Clear silicones lose 0.1 to 0.5 % of the light in a millimetre."""
