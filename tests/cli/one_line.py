"""Runs a command that must be refused."""

import pytest

from app.cli.main import MENDABLE, main


def refusal(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Run a command that must be refused, and return its one line."""
    assert main(arguments) == MENDABLE
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("gelpo")]
    assert len(lines) == 1
    assert "Traceback" not in lines[0]
    return lines[0]
