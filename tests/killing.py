"""A program that is killed at a moment which a seed says, for tests of what is left then."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import TextIO

HERE = Path(__file__).resolve().parent


def lines_until_killed(
    arguments: Sequence[str], *, paths: Sequence[Path], seed: int, longest_s: float
) -> list[str]:
    """Run Python with `paths` to import from, kill it, and return the lines that it printed.

    The moment is up to `longest_s` after its first line.
    """
    process = _start(arguments, paths)
    assert process.stdout is not None
    with process:
        lines = _lines(process.stdout, process.kill, seed, longest_s)
    assert process.returncode == -signal.SIGKILL, "it ended by itself"
    return lines


class Forks:
    """Copies of one process that has a module loaded, each to be killed; a context manager.

    Loading takes longer than the work that is killed.

    Parameters
    ----------
    module : str
        Its ``main()`` reads ``sys.argv`` and writes lines.
    paths : sequence of Path
        To import from.
    environment : dict, optional
        Further variables.
    """

    def __init__(
        self, module: str, paths: Sequence[Path], environment: dict[str, str] | None = None
    ) -> None:
        self._process = _start(
            [str(HERE / "forking.py"), module], paths, environment, stdin=subprocess.PIPE
        )

    def __enter__(self) -> Forks:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the process that the copies are made of."""
        self._process.communicate(timeout=600.0)

    def lines_until_killed(
        self, arguments: Sequence[str], folder: Path, *, seed: int, longest_s: float
    ) -> list[str]:
        """Run a copy, kill it, and return its lines; `folder` holds the pipe that they come by."""
        reported, asked = self._process.stdout, self._process.stdin
        assert reported is not None and asked is not None
        pipe = folder / "lines"
        os.mkfifo(pipe)
        asked.write(json.dumps({"out": str(pipe), "arguments": list(arguments)}) + "\n")
        asked.flush()
        copy = int(reported.readline())
        with pipe.open() as stream:
            lines = _lines(stream, lambda: os.kill(copy, signal.SIGKILL), seed, longest_s)
        assert int(reported.readline()) == signal.SIGKILL, "it ended by itself"
        return lines


def _start(
    arguments: Sequence[str],
    paths: Sequence[Path],
    environment: dict[str, str] | None = None,
    *,
    stdin: int | None = None,
) -> subprocess.Popen[str]:
    """Start Python with `paths` to import from."""
    return subprocess.Popen(
        [sys.executable, *arguments],
        stdin=stdin,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(map(str, paths))} | (environment or {}),
    )


def _lines(stream: TextIO, kill: Callable[[], None], seed: int, longest_s: float) -> list[str]:
    """Return the whole lines of a stream that ends because of `kill`."""
    first = stream.readline()
    end = threading.Timer(random.Random(seed).uniform(0.0, longest_s), kill)
    end.start()
    rest = stream.read()
    end.join()
    # A line that was cut off was not reported.
    return (first + rest).split("\n")[:-1]
