"""Who is at the machine."""

from __future__ import annotations

import getpass

from gelpolight_core.reading import as_text


def user_name() -> str:
    """Return the name of the user; empty on a system that knows none, such as a bare container."""
    try:
        return as_text(getpass.getuser())
    except (KeyError, OSError, ImportError):  # which of them depends on system and Python
        return ""
