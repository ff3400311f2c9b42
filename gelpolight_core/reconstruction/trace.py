"""Steps that were computed or skipped for a frame, with reasons."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

EFFORTS = ("fast", "balanced", "best")
"""The efforts, from the fastest to the most accurate."""


@dataclass(frozen=True, slots=True)
class TraceStep:
    """One step of a frame.

    Attributes
    ----------
    name : str
        The step.
    done : bool
        Whether it was needed.
    reason : str
        Why it was done in this way, or skipped, in a sentence for the user.
    milliseconds : float or None
        Time of the step; None where it was left out or not timed.
    bytes : int
        Bytes that the step must at least read and write; 0 if not counted.
    """

    name: str
    done: bool
    reason: str
    milliseconds: float | None = None
    bytes: int = 0

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
        """Name, reason and time of the step in one line."""
        time = "" if self.milliseconds is None else f" ({self.milliseconds:.1f} ms)"
        return f"{self.name}: {self.reason}{time}"


@dataclass(frozen=True, slots=True)
class Trace:
    """The steps of one frame in their order.

    Attributes
    ----------
    effort : str
        One of `EFFORTS`.
    steps : tuple of TraceStep
        Done and left out.
    """

    effort: str
    steps: tuple[TraceStep, ...] = ()

    @property
    def done(self) -> tuple[str, ...]:
        """Names of the steps that were done."""
        return tuple(step.name for step in self.steps if step.done)

    @property
    def skipped_names(self) -> tuple[str, ...]:
        """Names of the steps that were not needed."""
        return tuple(step.name for step in self.steps if not step.done)

    def as_dicts(self) -> list[dict[str, Any]]:
        """Return plain values for JSON."""
        return [step.as_dict() for step in self.steps]


@dataclass(slots=True)
class TraceRecorder:
    """Collects the steps of one frame as they happen."""

    steps: list[TraceStep] = field(default_factory=list)

    @contextmanager
    def add_done(self, name: str, size: int) -> Iterator[list[str]]:
        """Time a step that touches `size` bytes, for which the caller appends a reason."""
        reason: list[str] = []
        begin = perf_counter()
        yield reason
        milliseconds = 1e3 * (perf_counter() - begin)
        self.steps.append(TraceStep(name, True, "; ".join(reason), milliseconds, size))

    def add_skipped(self, name: str, reason: str) -> None:
        """Note a step that was not needed."""
        self.steps.append(TraceStep(name, False, reason))
