"""Limits the memory that the C library keeps for itself."""

from __future__ import annotations

import ctypes
import sys

# Options of the GNU C library: M_ARENA_MAX and M_MMAP_THRESHOLD.
ARENAS_OPTION, LARGE_OPTION = -8, -3
LARGE_BYTES = 8 << 20
"""Larger than an image of 1280 x 960 and its depth map. Allocating every frame again costs time."""


def limit_malloc_cache() -> None:
    """Make the C library keep little freed memory. Call this before any thread starts.

    The GNU C library gives each thread its own arena, up to eight per core, and each arena keeps
    the memory of the images that it handled: half a gigabyte more within minutes. This function
    limits the arenas to two. It also lets every block above :data:`LARGE_BYTES` come directly from
    the system and return there at once. By default the library raises this limit to 32 MB when such
    blocks are freed, and the gaps between other blocks then stay: 0.2 GB more within minutes.
    """
    if sys.platform.startswith("linux"):
        option = getattr(ctypes.CDLL(None), "mallopt", None)
        if option is not None:
            option(ARENAS_OPTION, 2)
            option(LARGE_OPTION, LARGE_BYTES)


def trim_malloc_cache() -> None:
    """Return freed memory that the C library keeps to the system.

    Every thread that handles images leaves some. After several page changes this is gigabytes, and
    half a gigabyte within an hour of live images alone. The call takes milliseconds, tens of them
    if much is kept. Only the GNU C library has such a call; others keep less.
    """
    if sys.platform.startswith("linux"):
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)
