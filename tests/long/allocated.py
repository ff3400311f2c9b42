"""What the C library says of the memory that it has given out and keeps."""

import ctypes
import math
from typing import ClassVar


class Allocated(ctypes.Structure):
    """``struct mallinfo2`` of the GNU C library, in its own names."""

    _fields_: ClassVar = [
        (name, ctypes.c_size_t)
        for name in ("arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks",
                     "uordblks", "fordblks", "keepcost")
    ]  # fmt: skip


def ask_allocator() -> Allocated | None:
    """Return its figures; None where the library has no such call."""
    ask = getattr(ctypes.CDLL(None), "mallinfo2", None)
    if ask is None:
        return None
    ask.restype = Allocated
    found: Allocated = ask()
    return found


def allocated_mb() -> tuple[float, float]:
    """Return what is given out, and what the library keeps; NaN where it does not say."""
    found = ask_allocator()
    if found is None:
        return math.nan, math.nan
    return (found.uordblks + found.hblkhd) / 1e6, found.fordblks / 1e6
