"""The guide's tables of measuring tools and export formats, made while its pages are built.

A hook of ProperDocs, which runs without the program's packages: the modules are read, not imported.
"""

import ast
from pathlib import Path
from typing import Any

CORE = Path(__file__).resolve().parents[2] / "gelpolight_core"
TOOLS = CORE / "measurement" / "tools"
TOOLS_MARK, FORMATS_MARK = "<!-- measuring tools -->", "<!-- export formats -->"
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


def format_rows() -> list[str]:
    """Return a row for each export format of a height map."""
    source = ast.parse((CORE / "output" / "formats.py").read_text("utf-8"))
    calls = [
        node.args
        for node in ast.walk(source)
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "Format"
    ]
    declared = [
        (ast.literal_eval(key), ast.literal_eval(title))
        for key, _, title, content in calls
        if isinstance(key, ast.Constant) and ast.unparse(content) != "Profile"
    ]
    return [f"| {key} | {title} |" for key, title in declared]


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Return a page with the tables in place of their marks."""
    tools = ["| tool | key | what to click | result |", "|---|---|---|---|", *tool_rows()]
    formats = ["| format | content |", "|---|---|", *format_rows()]
    tables = {TOOLS_MARK: tools, FORMATS_MARK: formats}
    for mark, rows in tables.items():
        markdown = markdown.replace(mark, "\n".join(rows))
    return markdown
