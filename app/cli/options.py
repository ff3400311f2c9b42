"""A command is a frozen dataclass: its fields are the arguments that argparse reads."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Self, get_args, get_origin, get_type_hints

from gelpolight_core.base.atomic_write import refuse_unwritable
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.number import read_number


def positional(metavar: str, help: str = "") -> Any:
    """Return a field that is known by its place among the arguments."""
    return field(metadata={"given": {"metavar": metavar, "help": help}})


def option(
    help: str = "", *flags: str, writes: bool = False, one_of: bool = False, **given: Any
) -> Any:
    """Return a field that is an option. Its type says what can be entered.

    Parameters
    ----------
    help : str, optional
        Text for the user.
    *flags : str
        Its names. Default: the name of the field.
    writes : bool, optional
        Whether it names a file that the command writes.
    one_of : bool, optional
        Whether it belongs to the alternatives of the command, of which one is required.
    **given
        Passed on to :meth:`argparse.ArgumentParser.add_argument`.
    """
    given["help"] = help
    return field(metadata={"flags": flags, "writes": writes, "one_of": one_of, "given": given})


def output(metavar: str, help: str = "", *, writes: bool = True) -> Any:
    """Return the field of the result: a file, or else a folder."""
    return option(help, "-o", "--output", writes=writes, metavar=metavar)


file_option = partial(option, metavar="FILE")
result_option = partial(file_option, writes=True)


@dataclass(frozen=True)
class Command:
    """A command of the command line with its arguments."""

    @classmethod
    def add_arguments(cls, parser: argparse.ArgumentParser) -> set[str]:
        """Add the fields to a parser, and return the names of the options with two values."""
        types, pairs = get_type_hints(cls), set[str]()
        alternatives: Any = None
        for f in fields(cls):
            kind, given = types[f.name], f.metadata["given"]
            if "flags" not in f.metadata:
                optional = {"nargs": "?"} if NoneType in get_args(kind) else {}
                parser.add_argument(f.name, **_reading(kind, f.name) | optional | given)
                continue
            target = parser
            if f.metadata["one_of"]:
                alternatives = alternatives or parser.add_mutually_exclusive_group(required=True)
                target = alternatives
            elif kind is not bool and NoneType not in get_args(kind) and "default" not in given:
                given = given | {"required": True}
            flags = f.metadata["flags"] or (f"--{f.name.replace('_', '-')}",)
            added = target.add_argument(*flags, dest=f.name, **_reading(kind, flags[0]) | given)
            if added.nargs == 2:
                pairs.update(flags)
        return pairs

    @classmethod
    def of(cls, parsed: argparse.Namespace) -> Self:
        """Return the command with the arguments that a parser has read."""
        return cls(**{f.name: getattr(parsed, f.name) for f in fields(cls)})

    def run(self) -> int | None:
        """Do the work. Return the exit status, by default 0."""
        raise NotImplementedError

    def check_files(self) -> None:
        """Refuse a result that would overwrite a file that is used, or cannot be written."""
        used: list[Path] = []
        results: list[Path] = []
        for f in fields(self):
            value = getattr(self, f.name)
            paths = value if isinstance(value, list) else [value]
            (results if f.metadata.get("writes") else used).extend(
                path for path in paths if isinstance(path, Path)
            )
        refuse_overwriting(results, used)
        for path in results:
            refuse_unwritable(path)


def _reading(kind: Any, where: str) -> dict[str, Any]:
    """Return how argparse reads the values of a type."""
    if kind is bool:
        return {"action": "store_true"}
    parts = [part for part in get_args(kind) if part is not NoneType]
    if isinstance(kind, UnionType):
        return _reading(parts[0], where)
    if get_origin(kind) is list:
        return {"nargs": "+"} | _reading(parts[0], where)
    if get_origin(kind) is tuple and Ellipsis not in parts:
        return {"nargs": len(parts)} | _reading(parts[0], where)
    return {"type": partial(read_number, where=where) if kind is float else kind}


def refuse_overwriting(results: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Raise an error if a result would overwrite an input, or another result.

    An input that is a folder stands for its images and descriptions.
    """
    from gelpolight_core.image.image_file import SUFFIXES

    taken = {path.resolve() for path in inputs}
    for path in results:
        target = path.resolve()
        # Of a folder, images and what is stated about them are not overwritten.
        is_protected = target.suffix.lower() in (*SUFFIXES, ".toml")
        inside = is_protected and target.exists() and taken & {*target.parents}
        if target in taken or inside:
            raise InputError(
                "The result would overwrite a file that is used here", path, Remedy.CHOOSE_NAME
            )
        taken.add(target)
