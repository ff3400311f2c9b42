"""Work buffers that are reused from frame to frame."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


class BufferPool:
    """Work arrays by name, with undefined content."""

    def __init__(self) -> None:
        self._kept: dict[str, NDArray[Any]] = {}

    def take(
        self, name: str, shape: tuple[int, ...], dtype: type[np.generic] = np.float32
    ) -> NDArray[Any]:
        """Return an array of this shape and type with undefined content."""
        size = int(np.prod(shape))
        memory = self._kept.get(name)
        if memory is None or memory.size < size:
            memory = self._kept[name] = np.empty(size, dtype)
        return memory[:size].reshape(shape)
