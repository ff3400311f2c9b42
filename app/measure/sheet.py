"""What was drawn on one picture: its tools, in the order in which they were put there; no Qt."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gelpolight_core.measurement.tools import Tool


@dataclass(frozen=True, slots=True)
class Placed:
    """A tool on the picture; `key` stays the same whatever becomes of it."""

    key: int
    tool: Tool


@dataclass(frozen=True, slots=True)
class Sheet:
    """The tools on a picture; every change makes a new sheet."""

    items: tuple[Placed, ...] = ()

    def tool(self, key: int) -> Tool | None:
        """Return a tool; None where there is none of that key."""
        return next((item.tool for item in self.items if item.key == key), None)

    def next_key(self) -> int:
        """Return a key that no tool has."""
        return max((item.key for item in self.items), default=0) + 1

    def added(self, tool: Tool) -> Sheet:
        """Return it with one more tool."""
        return replace(self, items=(*self.items, Placed(self.next_key(), tool)))

    def changed(self, key: int, tool: Tool) -> Sheet:
        """Return it with another tool in the place of one."""
        items = tuple(replace(i, tool=tool) if i.key == key else i for i in self.items)
        return replace(self, items=items)

    def without(self, key: int) -> Sheet:
        """Return it without a tool."""
        return replace(self, items=tuple(i for i in self.items if i.key != key))
