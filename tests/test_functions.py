"""What a user can do is listed in functions.md, and each line names a test that is there."""

import ast
import re
from functools import cache
from pathlib import Path

TESTS = Path(__file__).parent
LINES = [
    [cell.strip() for cell in line.strip("| ").split(" | ")]
    for line in (TESTS / "functions.md").read_text("utf-8").splitlines()
    if line.startswith("|") and line not in ("| function | test |", "|---|---|")
]


@cache
def named_tests(path: Path) -> set[str]:
    tree = ast.parse(path.read_text("utf-8"))
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_each_function_is_held_by_a_test_that_exists():
    assert len(LINES) > 150
    missing = []
    for line in LINES:
        match = re.fullmatch(r"tests/(\S+\.py)::(test_\w+)", line[-1])
        path = TESTS / match[1] if match and len(line) == 2 and line[0] else None
        if path is None or not path.is_file() or match[2] not in named_tests(path):
            missing.append(line)
    assert not missing


def test_each_function_is_listed_once():
    functions = [function for function, _ in LINES]
    assert len(set(functions)) == len(functions)
