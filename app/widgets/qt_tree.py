"""The objects below one, without PySide6 keeping what has gone.

``findChildren`` makes everything that it returns a child of the object that was asked. Where that
is the main window, the Python halves of closed dialogs' widgets stay until the program ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeVar

from PySide6.QtCore import QObject

Kind = TypeVar("Kind", bound=QObject)


def below(root: QObject, kind: type[Kind], name: str = "") -> Iterator[Kind]:
    """Find the objects of a kind below one, each before what is below it.

    Parameters
    ----------
    root : QObject
        Where to look; it is not among what is found.
    kind : type
        Of what is looked for.
    name : str, optional
        Its object name; all where empty.

    Yields
    ------
    QObject
        The next of them.
    """
    for child in root.children():
        if isinstance(child, kind) and name in ("", child.objectName()):
            yield child
        yield from below(child, kind, name)
