"""Context managers of objects that are closed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Self


class Closable(ABC):
    """Something with `close`, which is called at the end of a ``with`` block."""

    @abstractmethod
    def close(self) -> None:
        """Close it, also repeatedly."""

    def __enter__(self) -> Self:
        """Return the object itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()
