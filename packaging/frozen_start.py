"""Where the frozen program starts; an installation has by itself what is arranged here."""

from __future__ import annotations

import multiprocessing
import os
import sys
from pathlib import Path

import platformdirs

# What the frozen program needs for itself would mislead the programs that it opens files with.
FOR_US_ALONE = ("LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "QT_PLUGIN_PATH", "QML2_IMPORT_PATH")


def give_back_environment() -> None:
    """Let a PDF viewer or a browser find its own libraries, not ours."""
    for name in FOR_US_ALONE:
        before = os.environ.pop(f"{name}_ORIG", None)
        if before is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = before


def choose_caches(folder: Path) -> None:
    """Keep compiled loops and the list of fonts in `folder`, away from those of an installation."""
    os.environ.setdefault("NUMBA_CACHE_DIR", str(folder / "kernels"))
    os.environ["MPLCONFIGDIR"] = str(folder / "matplotlib")


def start() -> int:
    """Run the command line; a process that was started as a worker becomes one."""
    give_back_environment()
    if multiprocessing.parent_process() is None and "NUMBA_CACHE_DIR" not in os.environ:
        choose_caches(platformdirs.user_cache_path("gelpolight"))
    multiprocessing.freeze_support()
    from app.cli.main import main

    return main()


if __name__ == "__main__":
    sys.exit(start())
