"""Compiled loops give the same numbers whether compiled just now or loaded from disk."""

import importlib
import pkgutil
from collections.abc import Iterator

import pytest
from numba.core.dispatcher import Dispatcher

import gelpolight_core


def _compiled() -> Iterator[Dispatcher]:
    for found in pkgutil.walk_packages(gelpolight_core.__path__, "gelpolight_core."):
        module = importlib.import_module(found.name)
        for value in vars(module).values():
            if isinstance(value, Dispatcher) and value.py_func.__module__ == found.name:
                yield value


@pytest.mark.parametrize("outer", list(_compiled()), ids=lambda d: d.py_func.__qualname__)
def test_a_compiled_loop_inlines_what_it_calls(outer):
    # A compiled function that is called but not inlined exists twice: by itself and as a copy in
    # its caller. Where arithmetic may be reordered (fastmath) the two are optimised differently.
    # Which of them runs depends on whether the caller was compiled in this process or loaded
    # from disk.
    code, names = outer.py_func.__code__, outer.py_func.__globals__
    called = [names[n] for n in code.co_names if isinstance(names.get(n), Dispatcher)]
    assert [
        c.py_func.__name__
        for c in called
        if not c.targetoptions.get("forceinline") and c.targetoptions.get("fastmath")
    ] == []
