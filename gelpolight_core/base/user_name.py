"""Name of the current user."""

from __future__ import annotations

import getpass

from .safe_reading import escape_undecodable


def user_name() -> str:
    """Return the login name of the user, or "" if the system has none (a bare container)."""
    try:
        return escape_undecodable(getpass.getuser())
    # which one depends on the system and the Python version
    except (KeyError, OSError, ImportError):
        return ""
