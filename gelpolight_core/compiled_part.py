"""How a part of a compiled loop is compiled: it is inlined there, and Python never calls it.

Without wrappers for Python and C, compiling takes a fifth less of a first start.
"""

from __future__ import annotations

from typing import Any

WITHOUT = ("no_cpython_wrapper", "no_cfunc_wrapper")
PART: dict[str, Any] = dict.fromkeys(("nogil", "cache", "forceinline", *WITHOUT), True)
