"""The number of code lines in each folder, which may fall by itself and rises only for a reason."""

import ast
import functools
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
WHAT_TO_DO = (
    "Remove something; or raise the number in tests/test_size.py, and say in the commit what was "
    "removed for it."
)

# Lines that are not blank, a comment or a docstring. "." holds the files beside the folders.
MOST = {
    "app/.": 348,
    "app/bench": 138,
    "app/calibrate": 4986,
    "app/cameras": 487,
    "app/command_line": 1510,
    "app/context": 391,
    "app/inspect": 1434,
    "app/live": 2433,
    "app/measure": 2128,
    "app/sensors": 487,
    "app/services": 676,
    "app/shell": 906,
    "app/sources": 2337,
    "app/start": 126,
    "app/theme": 274,
    "app/view2d": 1066,
    "app/view3d": 1354,
    "app/widgets": 1081,
    "app/workspace": 370,
    "gelpolight_core/.": 1931,
    "gelpolight_core/batch": 588,
    "gelpolight_core/calibration": 4036,
    "gelpolight_core/design": 219,
    "gelpolight_core/design_check": 307,
    "gelpolight_core/export": 538,
    "gelpolight_core/factors": 183,
    "gelpolight_core/geometry": 75,
    "gelpolight_core/image": 766,
    "gelpolight_core/in_place": 1339,
    "gelpolight_core/io": 975,
    "gelpolight_core/light": 1361,
    "gelpolight_core/lights": 568,
    "gelpolight_core/measurement": 3872,
    "gelpolight_core/optics": 1715,
    "gelpolight_core/radiance": 225,
    "gelpolight_core/reconstruction": 5878,
    "gelpolight_core/recording": 386,
    "gelpolight_core/records": 110,
    "gelpolight_core/reflectance": 2410,
    "gelpolight_core/report": 1253,
    "gelpolight_core/response": 390,
    "gelpolight_core/session": 747,
    "gelpolight_core/simulation": 2181,
    "gelpolight_core/studies": 1143,
    "tests/.": 1515,
    "tests/app": 9039,
    "tests/batch": 427,
    "tests/calibration": 1362,
    "tests/command_line": 887,
    "tests/data": 142,
    "tests/design": 94,
    "tests/design_check": 61,
    "tests/docs": 328,
    "tests/export": 441,
    "tests/factors": 68,
    "tests/golden": 246,
    "tests/image": 363,
    "tests/in_place": 1185,
    "tests/io": 193,
    "tests/light": 571,
    "tests/lights": 199,
    "tests/long": 1429,
    "tests/measurement": 1591,
    "tests/optics": 490,
    "tests/packaging": 268,
    "tests/radiance": 68,
    "tests/reconstruction": 2229,
    "tests/recording": 236,
    "tests/records": 330,
    "tests/reflectance": 980,
    "tests/report": 165,
    "tests/response": 127,
    "tests/session": 399,
    "tests/simulation": 624,
    "tests/strangers": 806,
    "tests/studies": 1007,
}


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


@functools.cache
def sizes() -> Counter[str]:
    """Return the code lines of every folder of the core, the program and the tests."""
    found: Counter[str] = Counter()
    for top in ("gelpolight_core", "app", "tests"):
        for path in (ROOT / top).rglob("*.py"):
            inside = path.relative_to(ROOT / top).parts
            folder = inside[0] if len(inside) > 1 else "."
            found[f"{top}/{folder}"] += code_lines(path.read_text(encoding="utf-8"))
    return found


def test_code_is_counted_without_blanks_comments_and_docstrings():
    head = '"""About.\n\nMore.\n"""\n# why\n\n'
    body = 'def f(\n    x\n):\n    """Do."""\n    return """a\nb"""\n'

    assert code_lines(head + body) == 5  # three of the signature, two of the text that is returned


def test_no_folder_grows():
    grown = [
        f"{folder} has {lines} code lines, {lines - MOST.get(folder, 0)} more than {MOST[folder]}"
        if folder in MOST
        else f"{folder} has {lines} code lines and no number yet"
        for folder, lines in sorted(sizes().items())
        if lines > MOST.get(folder, -1)
    ]

    assert not grown, "\n".join([*grown, WHAT_TO_DO])


def test_no_number_outlives_its_folder():
    gone = sorted(MOST.keys() - sizes().keys())
    assert not gone, f"Remove these lines from tests/test_size.py: {gone}"
