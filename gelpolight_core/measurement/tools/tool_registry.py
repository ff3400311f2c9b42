"""Every measuring tool, of this folder and of installed packages, and results as plain values."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, asdict, fields, replace
from importlib import import_module
from types import MappingProxyType
from typing import Any, cast

from gelpolight_core.base.plugins import TOOLS as PLUG_INS
from gelpolight_core.base.plugins import plug_ins
from gelpolight_core.measurement import tools

from .tool_base import SECTIONS, PaletteEntry, Tool, ToolResult, geometry_fields
from .tool_placing import clicks


def _tools_of_this_folder() -> Iterator[type[Tool]]:
    for module in pkgutil.iter_modules(tools.__path__, f"{tools.__name__}."):
        if module.name == __name__:
            continue
        for member in vars(import_module(module.name)).values():
            defined_here = getattr(member, "__module__", "") == module.name
            if defined_here and isinstance(member, type) and "name" in vars(member):
                yield member


def _is_tool(kind: Any) -> bool:
    """Return whether a package's class is a tool that clicks on the map are enough to place."""
    others = (field for field in fields(kind) if field not in geometry_fields(kind))
    placed = geometry_fields(kind) and all(field.default is not MISSING for field in others)
    prompts = len(kind.palette.prompts) in (0, clicks(kind))
    return bool(issubclass(kind, Tool) and kind.name and placed and prompts)


def _entry(name: str, entry: PaletteEntry, count: int) -> PaletteEntry:
    """Return an entry with the texts that follow from a tool's name and clicks."""
    prompts = tuple(f"Click point {number} of {count}" for number in range(1, count + 1))
    return replace(
        entry,
        label=entry.label or name.replace("-", " ").capitalize(),
        prompts=entry.prompts or (prompts if count > 1 else ("Click on the object",)),
    )


def _position(kind: type[Tool]) -> tuple[int, int, str]:
    return SECTIONS.index(kind.palette.section), kind.palette.order, kind.name


_OWN = {kind.name: kind for kind in sorted(_tools_of_this_folder(), key=_position)}
_INSTALLED: dict[str, type[Tool]] = {
    name: kind for name, kind in plug_ins(PLUG_INS, _is_tool).items() if name not in _OWN
}
TOOLS: Mapping[str, type[Tool]] = MappingProxyType(_OWN | _INSTALLED)
"""Every tool by its name, in the order of the palette. A package replaces none of ours."""
_ENTRIES = {name: kind.palette for name, kind in _OWN.items()} | {
    name: replace(kind.palette, section=SECTIONS[-1], key="") for name, kind in _INSTALLED.items()
}
PALETTE: Mapping[str, PaletteEntry] = MappingProxyType(
    {name: _entry(name, entry, clicks(TOOLS[name])) for name, entry in _ENTRIES.items()}
)
"""The entries of all tools. Those of packages are below ours, without a key."""
DEPTH_FIGURES = frozenset(figure for kind in TOOLS.values() for figure in kind.depth_figures)
"""Names of the figures that are depths."""


def palette_entry(name: str) -> PaletteEntry:
    """Return the entry of a tool, also of one that is not installed any more."""
    return PALETTE.get(name) or _entry(name, PaletteEntry(), 1)


def tool_as_dict(tool: Tool) -> dict[str, Any]:
    """Return a tool as plain values. ``tool`` holds its name."""
    return {"tool": tool.name, **_plain(asdict(cast(Any, tool)))}


def result_as_dict(result: ToolResult) -> dict[str, Any]:
    """Return a result as plain values: the tool, its figures, the verdict and the reason."""
    return {
        **tool_as_dict(result.tool),
        "figures": [figure.as_json() for figure in result.figures],
        "verdict": result.verdict,
        "reason": result.reason,
    }


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(part) for part in value]
    return value
