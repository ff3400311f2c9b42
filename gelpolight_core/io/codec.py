"""Frozen dataclasses as plain values and arrays, and back, checked by their declarations.

The plain values go into JSON. Arrays are kept apart by the path of their field, such as
``data.full.background``. A field of a type that is not listed in :func:`unpack` is a fault of the
program, not of a file.
"""

from __future__ import annotations

import functools
import math
import types
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from datetime import UTC, datetime
from enum import Enum
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.io.reading import brief, written_text

T = TypeVar("T")
Arrays = Mapping[str, NDArray[Any]]


def pack(value: Any, arrays: dict[str, NDArray[Any]], path: str) -> Any:
    """Return a value as plain values for JSON, and put its arrays into `arrays`.

    Parameters
    ----------
    value : dataclass, mapping, sequence, array, text, number, time or None
        Fields without a value (None) are left out.
    arrays : dict
        Gets the arrays by their paths.
    path : str
        Of the value itself.
    """
    if isinstance(value, np.ndarray):
        arrays[path] = value
        return None
    if is_dataclass(value):
        named = ((f.name, getattr(value, f.name)) for f in _stored(value.__class__))
        packed = {name: pack(v, arrays, f"{path}.{name}") for name, v in named}
        return {name: v for name, v in packed.items() if v is not None}
    if isinstance(value, Mapping):
        return {key: pack(v, arrays, f"{path}.{key}") for key, v in value.items()}
    if isinstance(value, tuple | list):
        return [pack(v, arrays, f"{path}.{i}") for i, v in enumerate(value)]
    if isinstance(value, datetime):
        return time_text(value)
    return value.value if isinstance(value, Enum) else value


def time_text(time: datetime) -> str:
    """Return a time as text that sorts in the order of time."""
    return time.astimezone(UTC).isoformat(timespec="microseconds")


def unpack(kind: type[T], plain: Any, arrays: Arrays, path: str) -> T:
    """Return the value that :func:`pack` has stored.

    Parameters
    ----------
    kind : type
        A dataclass whose fields are dataclasses, mappings from text, tuples, arrays, enumerations,
        texts, numbers, times, or any of these or None. ``Any`` is what JSON can hold.
    plain : object
        Of the file.
    arrays : mapping
        Of the file, by their paths.
    path : str
        Of the value itself.

    Raises
    ------
    ValueError
        If a value is missing, unknown, of another type, or not finite.
    """
    found: T = _read(kind, plain, arrays, path)
    return found


def _read(kind: Any, plain: Any, arrays: Arrays, path: str) -> Any:
    origin, inside = get_origin(kind), get_args(kind)
    if kind is Any:
        return plain
    if origin in (Union, types.UnionType):
        if plain is None and not _holds(arrays, path):
            return None
        kinds = [part for part in inside if part is not types.NoneType]
        (one,) = [part for part in kinds if part is type(plain)] or kinds[:1]
        return _read(one, plain, arrays, path)
    if is_dataclass(kind):
        return _dataclass(kind, plain, arrays, path)
    if origin is np.ndarray:
        return _array(kind, arrays, path)
    if origin is tuple:
        return _tuple(inside, plain, arrays, path)
    if origin in (Mapping, dict):
        if not isinstance(plain, dict):
            raise ValueError(f"{path} is not a table")
        return {
            written_text(key): _read(inside[1], value, arrays, f"{path}.{key}")
            for key, value in plain.items()
        }
    return _scalar(kind, plain, path)


def _dataclass(kind: Any, plain: Any, arrays: Arrays, path: str) -> Any:
    if not isinstance(plain, dict):
        raise ValueError(f"{path} is missing")
    known = {f.name: f for f in _stored(kind)}
    if unknown := sorted(plain.keys() - known.keys()):
        raise ValueError(f"{path} has the unknown entry {brief(unknown[0])}")
    values = {}
    for name, field in known.items():
        inner = f"{path}.{name}"
        stored = name in plain or _holds(arrays, inner)
        if stored or (field.default is MISSING and field.default_factory is MISSING):
            values[name] = _read(_hints(kind)[name], plain.get(name), arrays, inner)
    return kind(**values)


def _holds(arrays: Arrays, path: str) -> bool:
    """Return whether there is an array at a path, or inside it."""
    return any(name == path or name.startswith(f"{path}.") for name in arrays)


def _array(kind: Any, arrays: Arrays, path: str) -> NDArray[Any]:
    if path not in arrays:
        raise ValueError(f"the array {path} is missing")
    array = arrays[path]
    dtype = get_args(get_args(kind)[1])[0]
    if array.dtype != np.dtype(dtype) or not np.isfinite(array).all():
        raise ValueError(f"{path} has impossible values")
    return array


def _tuple(inside: tuple[Any, ...], plain: Any, arrays: Arrays, path: str) -> tuple[Any, ...]:
    if not isinstance(plain, list):
        raise ValueError(f"{path} is {'missing' if plain is None else 'not a list'}")
    kinds = inside
    if len(inside) == 2 and inside[1] is Ellipsis:
        kinds = (inside[0],) * len(plain)
    if len(kinds) != len(plain):
        raise ValueError(f"{path} has {len(plain)} entries")
    pairs = enumerate(zip(kinds, plain, strict=True))
    return tuple(_read(kind, value, arrays, f"{path}.{i}") for i, (kind, value) in pairs)


def _scalar(kind: Any, plain: Any, path: str) -> Any:
    if kind is str:
        return written_text(plain)
    if kind is float and type(plain) in (int, float) and math.isfinite(plain):
        return float(plain)
    if kind is datetime and isinstance(plain, str):
        return datetime.fromisoformat(plain)
    if get_origin(kind) is Literal and isinstance(plain, str) and plain in get_args(kind):
        return plain
    if kind in (int, bool) and type(plain) is kind:
        return plain
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(plain)
    raise ValueError(f"{path} has the invalid value {brief(plain)}")


@functools.cache
def _stored(kind: Any) -> tuple[Field[Any], ...]:
    return tuple(field for field in fields(kind) if field.init)


@functools.cache
def _hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind)
