"""How much memory the C library keeps for itself."""

from __future__ import annotations

import ctypes
import sys

MALLOC_ARENAS = -8  # the GNU C library's M_ARENA_MAX
ARENAS = 2


def keep_arenas_few() -> None:
    """Let the threads to come share two stores of memory; to be called before there are any.

    The GNU C library gives each thread a store of its own, up to eight for each core, and each
    keeps the room of the pictures that went through it: half a gigabyte more within minutes.
    """
    if sys.platform.startswith("linux"):
        option = getattr(ctypes.CDLL(None), "mallopt", None)
        if option is not None:
            option(MALLOC_ARENAS, ARENAS)


def give_back() -> None:
    """Return to the system what the C library keeps of memory that was given back to it.

    Every thread that handles pictures leaves it some; after some changes of the page these are
    gigabytes. Only the GNU C library has a call for that; others keep less.
    """
    if sys.platform.startswith("linux"):
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)
