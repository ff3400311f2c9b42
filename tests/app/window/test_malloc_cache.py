"""Freed memory returns to the system, and threads share the rest."""

import ctypes
import threading
from pathlib import Path

import pytest

from app.window.malloc_cache import trim_malloc_cache

PIECE, PIECES = 60_000, 3000


def resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


@pytest.mark.skipif(
    not hasattr(ctypes.CDLL(None), "malloc_trim"), reason="a call of the GNU C library"
)
def test_memory_freed_by_a_thread_returns_to_the_system():
    """The last piece is still in use: without the call all memory below it would stay."""
    library = ctypes.CDLL(None)
    library.malloc.restype = ctypes.c_void_p
    library.free.argtypes = [ctypes.c_void_p]
    pieces: list[int] = []

    def work() -> None:
        for _ in range(PIECES):
            pieces.append(library.malloc(PIECE))
            ctypes.memset(pieces[-1], 1, PIECE)
        for piece in pieces[:-1]:
            library.free(piece)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    before_mb = resident_mb()
    trim_malloc_cache()
    assert before_mb - resident_mb() > 0.5e-6 * PIECE * PIECES
    library.free(pieces[-1])
