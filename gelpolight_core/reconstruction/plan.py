"""Which steps a frame needs, and why the others were left out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

EFFORTS = ("fast", "balanced", "best")
"""How much work a frame is worth, from least to most."""


@dataclass(frozen=True, slots=True)
class PlanStep:
    """One step of a frame.

    Attributes
    ----------
    name : str
        The step.
    done : bool
        Whether it was needed.
    reason : str
        Why it was done so, or left out, in a sentence for a person.
    milliseconds : float or None
        What it took; None where it was left out or not timed.
    """

    name: str
    done: bool
    reason: str
    milliseconds: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "step": self.name,
            "done": self.done,
            "reason": self.reason,
            "milliseconds": self.milliseconds,
        }

    @property
    def sentence(self) -> str:
        """The step and its reason in one line."""
        took = "" if self.milliseconds is None else f" ({self.milliseconds:.1f} ms)"
        return f"{self.name}: {self.reason}{took}"


@dataclass(frozen=True, slots=True)
class Plan:
    """The steps of one frame in their order.

    Attributes
    ----------
    effort : str
        One of `EFFORTS`.
    steps : tuple of PlanStep
        Done and left out.
    """

    effort: str
    steps: tuple[PlanStep, ...] = ()

    @property
    def done(self) -> tuple[str, ...]:
        """Names of the steps that are done."""
        return tuple(step.name for step in self.steps if step.done)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Names of the steps that are left out."""
        return tuple(step.name for step in self.steps if not step.done)

    def as_dicts(self) -> list[dict[str, Any]]:
        """Return plain values for JSON."""
        return [step.as_dict() for step in self.steps]
