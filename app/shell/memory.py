"""How much memory the C library keeps for itself."""

from __future__ import annotations

import ctypes
import sys

# Options of the GNU C library: M_ARENA_MAX and M_MMAP_THRESHOLD.
ARENAS_OPTION, LARGE_OPTION = -8, -3
ARENAS = 2
LARGE_BYTES = 8 << 20
"""Above a picture of 1280 x 960 and a map of it; fetching every frame anew costs time."""


def keep_little() -> None:
    """Let the C library keep little of freed memory; to be called before there are threads.

    The GNU C library gives each thread a store of its own, up to eight for each core, and each
    keeps the room of the pictures that went through it: half a gigabyte more within minutes. Two
    are shared from now on. And whatever is larger than :data:`LARGE_BYTES` comes from the system
    and goes back there at once; by itself the library raises that bound to 32 MB as such blocks
    are freed, and what is left between others then stays: 0.2 GB more within minutes.
    """
    if sys.platform.startswith("linux"):
        option = getattr(ctypes.CDLL(None), "mallopt", None)
        if option is not None:
            option(ARENAS_OPTION, ARENAS)
            option(LARGE_OPTION, LARGE_BYTES)


def give_back() -> None:
    """Return to the system what the C library keeps of memory that was given back to it.

    Every thread that handles pictures leaves it some; after some changes of the page these are
    gigabytes, and half a gigabyte within an hour of live pictures alone. It takes milliseconds,
    tens of them where much is kept. Only the GNU C library has a call for that; others keep less.
    """
    if sys.platform.startswith("linux"):
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)
