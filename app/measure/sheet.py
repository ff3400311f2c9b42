"""The tools on one image, in the order of their placement. Without Qt."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gelpolight_core.measurement.tools import Tool


@dataclass(frozen=True, slots=True)
class Placed:
    """A tool on the image. Its `key` never changes."""

    key: int
    tool: Tool


@dataclass(frozen=True, slots=True)
class Sheet:
    """The tools on an image. Every change makes a new sheet."""

    items: tuple[Placed, ...] = ()

    def tool(self, key: int) -> Tool | None:
        """Return a tool, or None if the key is unknown."""
        return next((item.tool for item in self.items if item.key == key), None)

    def next_key(self) -> int:
        """Return an unused key."""
        return max((item.key for item in self.items), default=0) + 1

    def added(self, tool: Tool) -> Sheet:
        """Return a sheet with one more tool."""
        return replace(self, items=(*self.items, Placed(self.next_key(), tool)))

    def changed(self, key: int, tool: Tool) -> Sheet:
        """Return a sheet with one tool replaced."""
        items = tuple(replace(i, tool=tool) if i.key == key else i for i in self.items)
        return replace(self, items=items)

    def without(self, key: int) -> Sheet:
        """Return a sheet without a tool."""
        return replace(self, items=tuple(i for i in self.items if i.key != key))
