"""What a report of the Tools menu provides to its dialog."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

Progress = Callable[[str, float], None]


class ToolReport(Protocol):
    """A report: choices, work in the background, rows of text, files.

    Attributes
    ----------
    name, title, intro : str
        For object names, and for the user.
    heads : sequence of str
        Of the table's columns.
    """

    name: str
    title: str
    intro: str
    heads: Sequence[str]

    def choices(self) -> Sequence[tuple[str, Any]]:
        """Return what can be chosen, each with its label."""

    def run(self, choice: Any, progress: Progress) -> Any:
        """Do the work, in a background thread."""

    def rows(self, result: Any) -> Sequence[Sequence[str]]:
        """Return the table."""

    def summary(self, result: Any) -> str:
        """Return the result in one sentence."""

    def write(self, result: Any, folder: Path) -> Sequence[Path]:
        """Write the report's files, in a background thread."""
