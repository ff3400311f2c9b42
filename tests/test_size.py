"""The number of code lines of the core and of the program, which rises only for a reason."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

# Lines that are not blank, a comment or a docstring.
LINES = {"gelpolight_core": 36_200, "app": 22_420}
MARGIN = 1.02  # a usual change fits; many together do not


def code_lines(source: str) -> int:
    """Return how many lines are not blank, a comment or a docstring."""
    rows = enumerate(source.split("\n"), start=1)
    lines = {row for row, line in rows if line.strip() and not line.lstrip().startswith("#")}
    nodes = list(ast.walk(ast.parse(source)))
    for node in nodes:
        if isinstance(node, ast.Constant | ast.JoinedStr):  # a text may hold blank lines
            lines.update(range(node.lineno, (node.end_lineno or 0) + 1))
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    for node in nodes:
        if isinstance(node, documented) and ast.get_docstring(node, clean=False) is not None:
            lines -= set(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    return len(lines)


def test_code_is_counted_without_blanks_comments_and_docstrings():
    head = '"""About.\n\nMore.\n"""\n# why\n\n'
    body = 'def f(\n    x\n):\n    """Do."""\n    return """a\nb"""\n'

    assert code_lines(head + body) == 5  # three of the signature, two of the text that is returned


@pytest.mark.parametrize("package", LINES)
def test_the_code_does_not_grow(package):
    files = (ROOT / package).rglob("*.py")
    lines = sum(code_lines(path.read_text("utf-8")) for path in files)

    assert lines <= MARGIN * LINES[package], (
        f"{package} has {lines} code lines. Remove something; or raise the number in "
        "tests/test_size.py, and say in the commit why."
    )
