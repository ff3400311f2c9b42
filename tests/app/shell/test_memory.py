"""Freed memory returns to the system, and threads share the rest."""

from __future__ import annotations

import ctypes
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from app.context.context import AppContext
from app.context.pages import PageEntry
from app.shell import main_window
from app.shell.main_window import MainWindow
from app.shell.memory import give_back

ROOT = Path(__file__).resolve().parents[3]
PIECE, PIECES = 60_000, 3000


def resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


@pytest.mark.skipif(
    not hasattr(ctypes.CDLL(None), "malloc_trim"), reason="a call of the GNU C library"
)
def test_memory_freed_by_a_thread_returns_to_the_system() -> None:
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
    give_back()
    assert before_mb - resident_mb() > 0.5e-6 * PIECE * PIECES
    library.free(pieces[-1])


def test_the_window_releases_memory_after_a_page_change_and_regularly(
    context: AppContext, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(main_window, "TIDY_MS", 0)
    given: list[bool] = []
    monkeypatch.setattr(main_window, "give_back", lambda: given.append(True))
    pages = tuple(
        PageEntry(name, name, "sensors", "app.sensors.page:SensorsPage") for name in ("one", "two")
    )
    window = MainWindow(context=context, pages=pages)
    qtbot.addWidget(window)
    window.show_page("one")
    qtbot.waitUntil(lambda: window.page_name == "one" and bool(given), timeout=20_000)
    given.clear()
    window.show_page("two")
    qtbot.waitUntil(lambda: bool(given), timeout=20_000)
    monkeypatch.setattr(main_window, "TIDY_AGAIN_MS", 0)
    window.show_page("one")
    given.clear()
    qtbot.waitUntil(lambda: len(given) > 2, timeout=20_000)
    window.close()


HOARD = """
import ctypes, sys, threading
from app.shell.memory import keep_little
if sys.argv[1] == "few":
    keep_little()
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
def test_threads_share_few_memory_arenas() -> None:
    stores = {
        how: int(subprocess.check_output([sys.executable, "-c", HOARD, how]))
        for how in ("few", "many")
    }
    assert stores["few"] <= 2 < stores["many"]


LARGE = """
import ctypes, sys
from app.shell.memory import LARGE_BYTES, keep_little
sys.path.insert(0, "tests/long")
from allocated import ask_allocator
keep_little()
library = ctypes.CDLL(None)
library.malloc.restype = ctypes.c_void_p
library.malloc.argtypes = [ctypes.c_size_t]
library.free.argtypes = [ctypes.c_void_p]
library.free(library.malloc(3 * LARGE_BYTES))  # by itself it raises the bound to that
before = ask_allocator().hblks
place = library.malloc(2 * LARGE_BYTES)
print(ask_allocator().hblks - before)
"""


@pytest.mark.skipif(
    not hasattr(ctypes.CDLL(None), "mallinfo2"), reason="a call of the GNU C library"
)
def test_large_blocks_come_from_the_system_after_any_free() -> None:
    """Without the option threads almost never share one, so no comparison is possible."""
    found = subprocess.check_output([sys.executable, "-c", LARGE], cwd=ROOT)
    assert int(found) == 1
