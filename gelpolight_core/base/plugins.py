"""Extensions by other people's packages: the entry points of an installed package."""

from __future__ import annotations

import logging
from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Any

EXPORTS, TOOLS, CAMERAS = "gelpolight.exports", "gelpolight.tools", "gelpolight.cameras"
_LOG = logging.getLogger(__name__)


def plug_ins(group: str, check: Callable[[Any], object] = callable) -> dict[str, Any]:
    """Return what installed packages add to a group.

    A faulty one is left out, and the log says which, in one sentence.

    Parameters
    ----------
    group : str
        :data:`EXPORTS`, :data:`TOOLS` or :data:`CAMERAS`.
    check : callable, optional
        Fails, or returns something false, for an object that is none of this group.

    Returns
    -------
    dict
        The loaded object for each name, in the order of the names.
    """
    loaded_by_name = {}
    for point in sorted(entry_points(group=group), key=lambda point: point.name):
        try:
            loaded = point.load()
            if not check(loaded):
                raise TypeError("it is not of this kind")
        except Exception as error:  # other people's code, which may fail in any way
            package = point.dist.name if point.dist else point.value
            text = f"The extension {point.name} of the package {package} is left out ({error})"
            _LOG.warning(text)
            continue
        loaded_by_name[point.name] = loaded
    return loaded_by_name
