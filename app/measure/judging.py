"""What was measured beside what is true: errors, and whether they are within the limits.

The errors of the fitted indenters are those that ``gelpolight measure --truth`` tells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from app.shell.settings import Limits
from gelpolight_core.errors import InputError
from gelpolight_core.measurement.result import Measurement, Truth, compare
from gelpolight_core.measurement.tools import ToolResult
from gelpolight_core.translation import tr

DEPTH_FIGURES = frozenset({"step_height", "height", "depth_difference", "mean_depth", "deepest"})


@dataclass(frozen=True, slots=True)
class Stated:
    """What a person says is true of what a tool measures.

    Attributes
    ----------
    size_mm : float or None
        The diameter, the mean side, or the tool's first figure in its own unit; None: not known.
    height_mm : float or None
        How deep an indenter was pressed in; None: not known.
    name : str
        Name of the known indenter; empty where the numbers were typed.
    """

    size_mm: float | None = None
    height_mm: float | None = None
    name: str = ""


@dataclass(frozen=True, slots=True)
class Judged:
    """One figure beside the truth.

    Attributes
    ----------
    quantity : str
        ``size``, ``height`` or the figure's name.
    label, unit : str
        For people.
    measured, true : float
        In `unit`.
    error_percent : float
        Signed, of the true value.
    limit_percent : float
        Largest error to pass.
    """

    quantity: str
    label: str
    unit: str
    measured: float
    true: float
    error_percent: float
    limit_percent: float

    @property
    def error(self) -> float:
        """Measured less true, in `unit`."""
        return self.measured - self.true

    @property
    def passed(self) -> bool:
        """Whether the error is within the limit; never for a number that is not finite."""
        return abs(self.error_percent) <= self.limit_percent


def judge(result: ToolResult, stated: Stated, limits: Limits) -> tuple[Judged, ...]:
    """Compare a result with what is true of it.

    Returns
    -------
    tuple of Judged
        Empty where nothing is stated.

    Raises
    ------
    InputError
        If a stated length is not greater than zero.
    """
    if result.measurement is not None:
        return _judge_indenter(result.measurement, stated, limits)
    if stated.size_mm is None:
        return ()
    figure = result.figures[0]
    true = stated.size_mm
    if not (math.isfinite(true) and true > 0.0):
        raise InputError(
            tr("a true value of {value}").format(value=true),
            where=tr("truth"),
            advice=tr("Give a value greater than zero"),
        )
    # The sign of a step says in which order its areas were clicked.
    measured = abs(figure.value) if figure.name in DEPTH_FIGURES else figure.value
    in_depth = figure.name in DEPTH_FIGURES
    limit = limits.height_percent if in_depth else limits.size_percent
    error = 100.0 * (measured / true - 1.0)
    return (Judged(figure.name, figure.label, figure.unit, measured, true, error, limit),)


def _judge_indenter(fit: Measurement, stated: Stated, limits: Limits) -> tuple[Judged, ...]:
    if stated.size_mm is None and stated.height_mm is None:
        return ()
    # What is not known is taken as measured, and nothing is told of it.
    size = fit.size_mm if stated.size_mm is None else stated.size_mm
    height = fit.height_mm if stated.height_mm is None else stated.height_mm
    found = compare(fit, Truth(fit.shape, size, height))
    rows = []
    if stated.size_mm is not None:
        label = tr("mean side") if fit.shape == "cuboid" else tr("diameter")
        error, limit = found.size_error_percent, limits.size_percent
        rows.append(Judged("size", label, "mm", fit.size_mm, size, error, limit))
    if stated.height_mm is not None:
        error, limit = found.height_error_percent, limits.height_percent
        rows.append(Judged("height", tr("depth"), "mm", fit.height_mm, height, error, limit))
    return tuple(rows)
