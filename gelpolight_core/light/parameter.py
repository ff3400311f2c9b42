"""Parameters of the light of a sensor: start, limits, prior with its source, and neutral value."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum, auto

import numpy as np

from gelpolight_core.base.channels import CHANNEL_KEYS

UNLIMITED = (-np.inf, np.inf)


class PriorSource(IntEnum):
    """Where a prior comes from. The residuals of priors are in this order."""

    MIRROR = auto()
    HOUSING = auto()
    DATA_SHEET = auto()
    USUAL_MEMBRANE = auto()
    USUAL_GEL = auto()
    WHITE_BOARD = auto()
    LAMBERT = auto()
    MOULD = auto()


@dataclass(frozen=True, slots=True)
class Prior:
    """What is known of a parameter beforehand.

    Attributes
    ----------
    mean : float or None
        Expected value. None: the start value.
    sd : float
        Standard deviation.
    source : PriorSource
        Where it comes from.
    """

    mean: float | None
    sd: float
    source: PriorSource


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of the joint refinement.

    Attributes
    ----------
    key : str
        Short name. Parameters with the same key belong to different channels or presses, so that no
        residual depends on two of them.
    name : str
        Display name.
    start : float
        Value at which a fit starts.
    limits : (float, float)
        Smallest and largest value.
    prior : Prior or None
        Knowledge beforehand.
    neutral : float
        Value without any effect.
    typical_change : float
        Change during a fit.
    free : bool
        Whether it is fitted.
    channel : int or None
        The only channel that it affects. None: all.
    press : int or None
        The only press that it affects, by its number. None: all.
    moves_surface : bool
        Whether rays meet the membrane elsewhere.
    figure : str
        Text of its row in the report; empty for none.
    unit : str
        Unit in this row.
    warn : float or None
        Value above which this row is a warning.
    """

    key: str
    name: str
    start: float
    limits: tuple[float, float] = UNLIMITED
    prior: Prior | None = None
    neutral: float = 0.0
    typical_change: float = 0.1
    free: bool = True
    channel: int | None = None
    press: int | None = None
    moves_surface: bool = False
    figure: str = ""
    unit: str = ""
    warn: float | None = None

    @property
    def full_key(self) -> str:
        """Name in files: the key, with the channel if it belongs to one."""
        return self.key if self.channel is None else f"{self.key}_{CHANNEL_KEYS[self.channel]}"

    def fixed(self, value: float) -> Parameter:
        """Return the parameter at a value that is not fitted."""
        return replace(self, start=value, free=False)


@dataclass(frozen=True, slots=True)
class Term:
    """Parameters that a sensor needs together, or not at all.

    Attributes
    ----------
    key, name : str
        For files, and for people.
    parameters : tuple of Parameter
        They are fitted together.
    always : bool
        Whether every sensor needs it. Otherwise held-out presses decide, and without them all
        parameters are neutral.
    """

    key: str
    name: str
    parameters: tuple[Parameter, ...] = field(default=(), kw_only=True)
    always: bool = field(default=False, kw_only=True)
