"""Convert frozen dataclasses to plain values and arrays and back, checked by declarations.

The plain values go into JSON or TOML. Arrays are kept apart by the path of their field, such as
``data.full.background``. A field of a type that is not listed in :func:`unpack` is a fault of the
program, not of a file. What a value can be is declared beside its type, and its place in the file
where it has another one than its name::

    width_px: Annotated[int, Span(32, 20_000)] = place("camera.width_px")
"""

from __future__ import annotations

import functools
import sys
import types
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from datetime import UTC, datetime
from enum import Enum
from pathlib import Path
from typing import (
    Annotated,
    Any,
    Literal,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np
from numpy.typing import NDArray

from .errors import InputError, Remedy
from .limits import OneOf, Span
from .safe_reading import NEWEST, multiline_text, refuse_newer, short_repr

T = TypeVar("T")
ArraysByPath = Mapping[str, NDArray[Any]]
Keys = tuple[str | int, ...]
"""Path of a value, from the outside in; whole numbers are places in lists."""


class Unfit(ValueError):
    """A stored value that cannot be.

    Attributes
    ----------
    as_written : str
        What is wrong, with table and key as they are in a TOML file.
    """

    def __init__(self, keys: Keys, what: str) -> None:
        names: list[str] = []
        for key in keys:
            if isinstance(key, int):
                names[-1] += f"[{key}]"
            else:
                names.append(short_repr(key))
        super().__init__(f"{'.'.join(names)} {what}")
        *tables, name = names or ["the file"]
        self.as_written = f"[{'.'.join(tables)}] {name} {what}" if tables else f"{name} {what}"


def place(*keys: str, default: Any = MISSING, needed: bool = False) -> Any:
    """Return a field that is at another place than its name, such as ``camera.width_px``.

    A tuple can have a place for each of its entries. A field that is needed must be in the file,
    although the program has a default.
    """
    return field(default=default, metadata={"places": keys, "needed": needed})


def pack(value: Any, arrays: dict[str, NDArray[Any]], path: str) -> Any:
    """Return a value as plain values for JSON, and put its arrays into `arrays`.

    Parameters
    ----------
    value : dataclass, mapping, sequence, array, text, number, time or None
        Fields without a value (None) are left out.
    arrays : dict
        Gets the arrays by their paths.
    path : str
        Path of the value itself.
    """
    if isinstance(value, np.ndarray):
        arrays[path] = value
        return None
    if is_dataclass(value):
        return _pack_fields(value, arrays, path)
    if isinstance(value, Mapping):
        return {key: pack(v, arrays, f"{path}.{key}") for key, v in value.items()}
    if isinstance(value, tuple | list):
        return [pack(v, arrays, f"{path}.{i}") for i, v in enumerate(value)]
    if isinstance(value, datetime):
        return time_text(value)
    return value.value if isinstance(value, Enum) else value


def _pack_fields(value: Any, arrays: dict[str, NDArray[Any]], path: str) -> dict[str, Any]:
    packed: dict[str, Any] = {}
    for f in _stored(value.__class__):
        stored, places = getattr(value, f.name), _places(f)
        for part, (*tables, key) in zip(
            stored if len(places) > 1 else (stored,), places, strict=True
        ):
            plain = pack(part, arrays, ".".join((path, *tables, key)))
            if plain is not None:
                table = packed
                for name in tables:
                    table = table.setdefault(name, {})
                table[key] = plain
    return packed


def time_text(time: datetime) -> str:
    """Return a time as text that sorts in the order of time."""
    return time.astimezone(UTC).isoformat(timespec="microseconds")


def unpack(kind: type[T], plain: Any, arrays: ArraysByPath, path: str) -> T:
    """Return the value that :func:`pack` has stored.

    Parameters
    ----------
    kind : type
        A dataclass whose fields are dataclasses, mappings from text, tuples, arrays, enumerations,
        texts, numbers, times, or any of these or None. ``Any`` is what JSON can hold. Texts and
        numbers can be annotated with what they can be (:mod:`gelpolight_core.base.limits`).
    plain : object
        Plain values of the file.
    arrays : mapping
        Arrays of the file by their paths.
    path : str
        Path of the value itself; empty for a whole file.

    Raises
    ------
    ValueError
        If a value is missing, unknown, of another type, out of its range, or not finite.
    """
    value: T = _read(kind, plain, arrays, (path,) if path else ())
    return value


def unpack_toml(
    kind: type[T],
    content: Any,
    where: Path | str,
    form: tuple[str, int] | None = None,
    *,
    table: str = "",
) -> T:
    """Return what the content of a TOML file states.

    Parameters
    ----------
    kind : type
        A dataclass without arrays, as for :func:`unpack`.
    content : object
        Content of the file.
    where : Path or str
        The file, for the error.
    form : (str, int), optional
        Its format and the newest version that this program reads, if the file states them.
    table : str, optional
        The table or key that the content is of, if not the whole file.

    Raises
    ------
    InputError
        If the file is newer, or a key is unknown, missing, of the wrong type or out of range.
    """
    try:
        if form is not None:
            head = {key: content.get(key) for key in ("format", "version")}
            content = {key: value for key, value in content.items() if key not in head}
            _read(Annotated[str, OneOf(form[0])], head["format"], {}, ("format",))
            version = _read(Annotated[int, Span(1, NEWEST)], head["version"], {}, ("version",))
            refuse_newer(version, form[1], Path(where))
        stated: T = _read(kind, content, {}, tuple(table.split(".")) if table else ())
        return stated
    except Unfit as error:
        raise InputError(error.as_written, where, Remedy.CORRECT_ENTRY) from error


def span_of(kind: Any, name: str) -> Span:
    """Return what a number of a dataclass can be."""
    span: Span = get_args(_hints(kind)[name])[1]
    return span


def _read(kind: Any, plain: Any, arrays: ArraysByPath, keys: Keys) -> Any:
    origin, inside = get_origin(kind), get_args(kind)
    if kind is Any:
        return plain
    if origin in (Union, types.UnionType):
        if plain is None and not _holds(arrays, keys):
            return None
        kinds = [part for part in inside if part is not types.NoneType]
        (one,) = [part for part in kinds if _is_of(plain, part)] or kinds[:1]
        return _read(one, plain, arrays, keys)
    if is_dataclass(kind):
        return _dataclass(kind, plain, arrays, keys)
    if origin is np.ndarray:
        return _array(kind, arrays, keys)
    if origin is tuple:
        return _tuple(inside, plain, arrays, keys)
    if origin in (Mapping, dict):
        if not isinstance(plain, dict):
            raise Unfit(keys, "is not a table")
        return {
            _read(inside[0], key, {}, (*keys, key)): _read(inside[1], value, arrays, (*keys, key))
            for key, value in plain.items()
        }
    if plain is None:
        raise Unfit(keys, "is missing")
    if origin is Annotated:
        return _limited(inside[0], inside[1], plain, keys)
    try:
        return _scalar(kind, plain)
    except ValueError as error:
        raise Unfit(keys, f"is {_shown(plain)}, not {_NAMES.get(kind, 'possible')}") from error


def _dataclass(kind: Any, plain: Any, arrays: ArraysByPath, keys: Keys) -> Any:
    return kind(**_read_table(_tree(kind), plain, arrays, keys, {}))


def _is_of(plain: Any, kind: Any) -> bool:
    return kind is type(plain) or (get_origin(kind) is tuple and isinstance(plain, list))


def _read_table(
    tree: _Tree, plain: Any, arrays: ArraysByPath, keys: Keys, values: dict[str, Any]
) -> dict[str, Any]:
    """Return `values` with the fields of a table and of the tables in it."""
    if not isinstance(plain, dict):
        raise Unfit(keys, "is missing" if plain is None else "is not a table")
    if unknown := sorted(plain.keys() - tree.keys()):
        raise Unfit((*keys, unknown[0]), f"is unknown, not one of {', '.join(tree)}")
    for key, leaf in tree.items():
        inner = (*keys, key)
        if isinstance(leaf, dict):
            _read_table(leaf, plain.get(key, {}), arrays, inner, values)
        elif key in plain or leaf.is_needed or _holds(arrays, inner):
            entry = _read(leaf.kind, plain.get(key), arrays, inner)
            values[leaf.name] = (*values.get(leaf.name, ()), entry) if leaf.is_part else entry
        elif leaf.is_part:
            values[leaf.name] = (*values.get(leaf.name, ()), leaf.default)
    return values


def _holds(arrays: ArraysByPath, keys: Keys) -> bool:
    """Return whether there is an array at a path, or inside it."""
    path = ".".join(map(str, keys)) if arrays else ""
    return any(name == path or name.startswith(f"{path}.") for name in arrays)


def _array(kind: Any, arrays: ArraysByPath, keys: Keys) -> NDArray[Any]:
    path = ".".join(map(str, keys))
    if path not in arrays:
        raise Unfit(keys, "is missing, an array")
    array = arrays[path]
    dtype = get_args(get_args(kind)[1])[0]
    if array.dtype != np.dtype(dtype) or not np.isfinite(array).all():
        raise Unfit(keys, "has impossible values")
    return array


def _tuple(
    inside: tuple[Any, ...], plain: Any, arrays: ArraysByPath, keys: Keys
) -> tuple[Any, ...]:
    if not isinstance(plain, list):
        raise Unfit(keys, "is missing" if plain is None else f"is {_shown(plain)}, not a list")
    kinds = inside
    if len(inside) == 2 and inside[1] is Ellipsis:
        kinds = (inside[0],) * len(plain)
    if len(kinds) != len(plain):
        raise Unfit(keys, f"has {len(plain)} entries, not {len(kinds)}")
    pairs = enumerate(zip(kinds, plain, strict=True))
    return tuple(_read(kind, value, arrays, (*keys, i)) for i, (kind, value) in pairs)


def _limited(kind: Any, limit: Any, plain: Any, keys: Keys) -> Any:
    kinds = (int, float) if kind is float else kind
    if isinstance(plain, kinds) and not isinstance(plain, bool) and limit.holds(plain):
        return kind(plain)
    expected = str(limit).replace("number", "whole number") if kind is int else limit
    raise Unfit(keys, f"is {_shown(plain)}, not {expected}")


def _shown(plain: Any) -> str:
    return f'"{short_repr(plain)}"' if isinstance(plain, str) else short_repr(plain)


def _scalar(kind: Any, plain: Any) -> Any:
    if kind is str:
        return multiline_text(plain)
    is_number = isinstance(plain, int | float) and not isinstance(plain, bool)
    if kind is float and is_number and abs(plain) <= sys.float_info.max:
        return float(plain)
    if kind is datetime and isinstance(plain, str):
        return datetime.fromisoformat(plain)
    if get_origin(kind) is Literal and isinstance(plain, str) and plain in get_args(kind):
        return plain
    if kind in (int, bool) and type(plain) is kind:
        return plain
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(plain)
    raise ValueError


_NAMES = {str: "text", float: "a number", int: "a whole number", bool: "true or false"}


@dataclass(frozen=True, slots=True)
class _Leaf:
    """A place in a file: of a field, or of a part of it."""

    name: str
    kind: Any
    is_needed: bool
    is_part: bool
    default: Any


_Tree = dict[str, Any]
"""By key: a leaf, or the tree of a table."""


@functools.cache
def _tree(kind: Any) -> _Tree:
    top: _Tree = {}
    for f in _stored(kind):
        places, hint = _places(f), _hints(kind)[f.name]
        is_part = len(places) > 1
        default: Any = f.default
        has_default = default is not MISSING or f.default_factory is not MISSING
        is_needed = f.metadata.get("needed") or not has_default
        for i, (*tables, key) in enumerate(places):
            table, part = top, get_args(hint)[i] if is_part else hint
            for name in tables:
                table = table.setdefault(name, {})
            part_default = default[i] if is_part and not is_needed else None
            table[key] = _Leaf(f.name, part, is_needed, is_part, part_default)
    return top


def _places(f: Field[Any]) -> tuple[list[str], ...]:
    return tuple(key.split(".") for key in f.metadata.get("places") or (f.name,))


@functools.cache
def _stored(kind: Any) -> tuple[Field[Any], ...]:
    return tuple(field for field in fields(kind) if field.init)


@functools.cache
def _hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind, include_extras=True)
