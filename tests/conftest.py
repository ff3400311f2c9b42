"""Fixtures shared by all tests."""

from __future__ import annotations

from pathlib import Path

import pytest

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Return the folder of rendered sessions with truth, or skip where it is absent."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"the rendered sessions are not at {SHARED_DATA}")
    return SHARED_DATA
