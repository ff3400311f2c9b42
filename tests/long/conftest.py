"""Keeps the result of the proofs that take long: ``sh packaging/test.sh --long``."""

import subprocess
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from gelpolight_core import __version__

STARTED_S = time.monotonic()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the file of the result."""
    parser.addoption("--keep-result", type=Path, metavar="FILE", help="write the result here")


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Write when, on what, and how the proofs ended."""
    path = config.getoption("--keep-result")
    if path is None:
        return
    ended = {
        how: [report.nodeid for report in terminalreporter.stats.get(how, [])]
        for how in ("passed", "failed", "error", "skipped")
    }
    lines = [
        "# Last run of the proofs that take long",
        "",
        f"- date: {datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        f"- version: {__version__}, commit {_commit()}",
        f"- duration: {(time.monotonic() - STARTED_S) / 60.0:.0f} min",
        *(f"- {how}: {len(names)}" for how, names in ended.items()),
        *(f"    - {name}" for how in ("failed", "error") for name in ended[how]),
    ]
    path.write_text("\n".join(lines) + "\n", "utf-8")


def _commit() -> str:
    """Return the commit, marked where files differ from it."""
    command = ["git", "describe", "--always", "--dirty", "--exclude", "*"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "unknown"
