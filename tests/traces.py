"""The steps of a frame that were left out."""

from gelpolight_core.reconstruction.trace import Trace


def skipped_names(trace: Trace | None) -> frozenset[str]:
    """Return the names of the steps that a trace left out."""
    assert trace is not None
    return frozenset(step.name for step in trace.steps if not step.done)
