"""The use of a gel in words, for the live pages and the library."""

from __future__ import annotations

from app.workspace.gel_care import GelCare
from gelpolight_core.translation import tr

LEAST_S = 0.1
"""Shorter recovery times cannot be distinguished: they are only a few frames."""


def care_lines(care: GelCare) -> tuple[str, ...]:
    """Return the presses since a calibration, and the recovery of the first and last presses."""
    lines = [tr("Presses since the calibration: {n}").format(n=care.presses)]
    if care.early_s is not None and care.lately_s is not None:
        text = tr("Recovery after a press: {now} lately, {first} at first")
        lines.append(
            text.format(now=recovery_text(care.lately_s), first=recovery_text(care.early_s))
        )
    return tuple(lines)


def recovery_text(time_s: float) -> str:
    """Return a recovery time with its unit."""
    if time_s < LEAST_S:
        return tr("less than {t:.1f} s").format(t=LEAST_S)
    return tr("{t:.1f} s").format(t=time_s)
