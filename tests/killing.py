"""A program that is killed at a moment which a seed says, for tests of what is left then."""

import os
import random
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path


def lines_until_killed(
    arguments: Sequence[str], *, paths: Sequence[Path], seed: int, longest_s: float
) -> list[str]:
    """Run Python with `paths` to import from, kill it, and return the lines that it printed.

    The moment is up to `longest_s` after its first line.
    """
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, paths))}
    with subprocess.Popen(
        [sys.executable, *arguments], stdout=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stdout is not None
        first = process.stdout.readline()
        end = threading.Timer(random.Random(seed).uniform(0.0, longest_s), process.kill)
        end.start()
        rest = process.stdout.read()
        end.join()
    assert process.returncode == -signal.SIGKILL, "it ended by itself"
    # A line that was cut off was not reported.
    return (first + rest).split("\n")[:-1]
