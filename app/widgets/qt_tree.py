"""Find the objects below a Qt object without keeping deleted ones alive.

``findChildren`` makes everything that it returns a child of the object that was asked. If that is
the main window, the Python objects of closed dialogs' widgets stay until the program ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeVar

from PySide6.QtCore import QObject

Kind = TypeVar("Kind", bound=QObject)


def below(root: QObject, kind: type[Kind], name: str = "") -> Iterator[Kind]:
    """Find the objects of a kind below a root, each before its own children.

    Parameters
    ----------
    root : QObject
        Start of the search. It is not among the results.
    kind : type
        Type of the objects.
    name : str, optional
        Object name. Empty: any.

    Yields
    ------
    QObject
        The next object found.
    """
    for child in root.children():
        if isinstance(child, kind) and name in ("", child.objectName()):
            yield child
        yield from below(child, kind, name)
