"""Every text that a person reads goes through :func:`tr`, so that it can be translated."""

from __future__ import annotations

import gettext

_catalogue: gettext.NullTranslations = gettext.translation("gelpolight", fallback=True)


def tr(text: str) -> str:
    """Return `text` in the user's language; fill placeholders afterwards with ``str.format``."""
    return _catalogue.gettext(text)
