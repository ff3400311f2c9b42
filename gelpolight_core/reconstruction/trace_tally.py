"""How often each step ran in the last minute, and the time saved by skipped steps."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from gelpolight_core.reconstruction.trace import Trace


@dataclass(frozen=True, slots=True)
class StepCount:
    """One step over the window.

    Attributes
    ----------
    name : str
        The step.
    done, left_out : int
        Frames in which it ran, and in which it was left out.
    mean_ms : float or None
        Of the frames in which it ran; None where it never ran or was not timed.
    saved_ms : float or None
        Time saved by skipping it, if it would have taken as long as when it ran.
    """

    name: str
    done: int
    left_out: int
    mean_ms: float | None
    saved_ms: float | None


class TraceTally:
    """Counts the steps of the frames of the last minute.

    Parameters
    ----------
    window_s : float, optional
        Length of the window.

    Examples
    --------
    >>> from gelpolight_core.reconstruction.trace import Trace, TraceStep
    >>> tally = TraceTally()
    >>> tally.add(Trace("fast", (TraceStep("integration", True, "", 2.0),)), 0.0)
    >>> tally.add(Trace("fast", (TraceStep("integration", False, "not needed"),)), 1.0)
    >>> tally.counts(1.0)[0].saved_ms
    2.0
    """

    def __init__(self, window_s: float = 60.0) -> None:
        self._window_s = window_s
        self._traces: deque[tuple[float, Trace]] = deque()

    def add(self, trace: Trace, now_s: float) -> None:
        """Count a frame that was finished at a time of a steady clock, in seconds."""
        self._traces.append((now_s, trace))
        self._drop(now_s)

    def counts(self, now_s: float) -> tuple[StepCount, ...]:
        """Return all steps of the last minute, in the order in which they first appeared."""
        self._drop(now_s)
        times: dict[str, list[float]] = {}
        counts: dict[str, list[int]] = {}
        for _, trace in self._traces:
            for step in trace.steps:
                counts.setdefault(step.name, [0, 0])[0 if step.done else 1] += 1
                if step.milliseconds is not None:
                    times.setdefault(step.name, []).append(step.milliseconds)
        found = []
        for name, (done, left_out) in counts.items():
            mean = sum(times[name]) / len(times[name]) if name in times else None
            found.append(
                StepCount(name, done, left_out, mean, None if mean is None else mean * left_out)
            )
        return tuple(found)

    def lines(self, now_s: float) -> list[str]:
        """Return the counts as lines of text for people; empty where no frame was seen."""
        counts = self.counts(now_s)
        if not counts:
            return []
        lines = [f"Last minute, {len(self._traces)} frames:"]
        for step in counts:
            text = f"{step.name}: ran {step.done} times, left out {step.left_out} times"
            if step.mean_ms is not None:
                text += ", " + f"{step.mean_ms:.1f} ms each"
            if step.saved_ms:
                text += ", " + f"{1e-3 * step.saved_ms:.2f} s saved"
            lines.append(text)
        return lines

    def _drop(self, now_s: float) -> None:
        while self._traces and now_s - self._traces[0][0] > self._window_s:
            self._traces.popleft()
