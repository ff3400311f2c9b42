"""Memory that is of no more use goes back to the system."""

from __future__ import annotations

import ctypes
import sys


def give_back() -> None:
    """Return to the system what the C library keeps of memory that was given back to it.

    Every thread that handles pictures leaves it some; after some changes of the page these are
    gigabytes. Only the GNU C library has a call for that; others keep less.
    """
    if sys.platform.startswith("linux"):
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)
