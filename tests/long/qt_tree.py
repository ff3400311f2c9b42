"""Objects below a root, also those that Qt made itself."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeVar

from PySide6.QtCore import QObject

KindT = TypeVar("KindT", bound=QObject)


def find_children(root: QObject, kind: type[KindT], name: str = "") -> Iterator[KindT]:
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
        yield from find_children(child, kind, name)
