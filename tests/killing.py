"""A program that is killed at a moment which a seed says, for tests of what is left then."""

from __future__ import annotations

import os
import random
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path


def lines_until_killed(
    arguments: Sequence[str],
    *,
    paths: Sequence[Path],
    seed: int,
    longest_s: float,
    environment: dict[str, str] | None = None,
) -> list[str]:
    """Run Python with `paths` to import from, kill it, and return the lines that it has told.

    The moment is up to `longest_s` after its first line.
    """
    process = subprocess.Popen(
        [sys.executable, *arguments],
        stdout=subprocess.PIPE,
        text=True,
        env={
            **os.environ,
            "PYTHONPATH": os.pathsep.join(map(str, paths)),
            **(environment or {}),
        },
    )
    assert process.stdout is not None
    with process:
        first = process.stdout.readline()
        end = threading.Timer(random.Random(seed).uniform(0.0, longest_s), process.kill)
        end.start()
        rest = process.stdout.read()
        end.join()
    assert process.returncode == -9, "it ended by itself"
    # A line that was cut off was not told.
    return (first + rest).split("\n")[:-1]
