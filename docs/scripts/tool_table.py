"""The table of measuring tools in the guide, made of the tools' modules while its pages are built.

A hook of ProperDocs, which runs without the program's packages: the modules are read, not imported.
"""

import ast
from pathlib import Path
from typing import Any

TOOLS = Path(__file__).resolve().parents[2] / "gelpolight_core" / "measurement" / "tools"
MARK = "<!-- measuring tools -->"
DEFAULTS = {"order": 0, "tip": "", "prompts": ("Click on the object",), "key": ""}


def tool_rows() -> list[str]:
    """Return a row for each tool, in the order of the palette."""
    base = ast.parse((TOOLS / "tool_base.py").read_text("utf-8"))
    (sections,) = (
        ast.literal_eval(node.value)
        for node in base.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "SECTIONS"
    )
    entries: list[dict[str, Any]] = []
    for module in TOOLS.glob("*.py"):
        for node in ast.walk(ast.parse(module.read_text("utf-8"))):
            if isinstance(node, ast.ClassDef):
                values = {
                    ast.unparse(part.targets[0]): part.value
                    for part in node.body
                    if isinstance(part, ast.Assign)
                }
                if "name" in values and isinstance(palette := values.get("palette"), ast.Call):
                    label = ast.literal_eval(values["name"]).replace("-", " ").capitalize()
                    stated = {part.arg: ast.literal_eval(part.value) for part in palette.keywords}
                    entries.append(DEFAULTS | {"label": label} | stated)
    entries.sort(key=lambda e: (sections.index(e["section"]), e["order"], e["label"]))
    return [
        f"| **{e['label']}** | {e['key']} | {'. '.join(e['prompts'])} | {e['tip']} |"
        for e in entries
    ]


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Return a page with the table in place of its mark."""
    head = ["| tool | key | what to click | result |", "|---|---|---|---|"]
    return markdown.replace(MARK, "\n".join([*head, *tool_rows()]))
