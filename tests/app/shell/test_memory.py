"""The C library is kept from hoarding memory."""

from __future__ import annotations

import subprocess
import sys

import pytest

HOARD = """
import ctypes, sys, threading
from app.shell.memory import keep_arenas_few
if sys.argv[1] == "few":
    keep_arenas_few()
library = ctypes.CDLL(None)
library.malloc.restype = ctypes.c_void_p
places = [0] * 8
all_run = threading.Barrier(8)

def take(number):
    all_run.wait()
    places[number] = library.malloc(ctypes.c_size_t(1000))
    all_run.wait()

threads = [threading.Thread(target=take, args=(n,)) for n in range(8)]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
# Stores of threads lie at multiples of 64 MB.
print(len({place >> 26 for place in places}))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="other C libraries have no such stores")
def test_threads_share_a_few_stores_of_memory() -> None:
    stores = {
        how: int(subprocess.check_output([sys.executable, "-c", HOARD, how]))
        for how in ("few", "many")
    }
    assert stores["few"] <= 2 < stores["many"]
