"""Who is at the machine."""

from __future__ import annotations

import getpass


def user_name() -> str:
    """Return the name of the user; empty on a system that knows none, such as a bare container."""
    try:
        return getpass.getuser().encode("utf-8", "backslashreplace").decode()
    except (KeyError, OSError, ImportError):  # which of them depends on system and Python
        return ""
