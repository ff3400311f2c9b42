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
    "app/.": 360,
    "app/bench": 148,
    "app/calibrate": 5093,
    "app/cameras": 591,
    "app/command_line": 1777,
    "app/context": 495,
    "app/inspect": 1642,
    "app/live": 2732,
    "app/measure": 3440,
    "app/sensors": 757,
    "app/services": 831,
    "app/shell": 1224,
    "app/sources": 2478,
    "app/start": 138,
    "app/theme": 281,
    "app/tools": 333,
    "app/view2d": 1090,
    "app/view3d": 1549,
    "app/widgets": 1125,
    "app/workspace": 537,
    "gelpolight_core/.": 2058,
    "gelpolight_core/batch": 622,
    "gelpolight_core/calibration": 4136,
    "gelpolight_core/design": 316,
    "gelpolight_core/design_check": 316,
    "gelpolight_core/export": 716,
    "gelpolight_core/factors": 188,
    "gelpolight_core/image": 746,
    "gelpolight_core/in_place": 1424,
    "gelpolight_core/io": 684,
    "gelpolight_core/lab": 265,
    "gelpolight_core/light": 1427,
    "gelpolight_core/lights": 580,
    "gelpolight_core/measurement": 4729,
    "gelpolight_core/optics": 1804,
    "gelpolight_core/radiance": 230,
    "gelpolight_core/reconstruction": 6038,
    "gelpolight_core/recording": 494,
    "gelpolight_core/records": 487,
    "gelpolight_core/reflectance": 2521,
    "gelpolight_core/report": 1341,
    "gelpolight_core/response": 398,
    "gelpolight_core/session": 1010,
    "gelpolight_core/simulation": 2206,
    "gelpolight_core/studies": 1200,
    "tests/.": 1576,
    "tests/app": 9798,
    "tests/batch": 428,
    "tests/calibration": 1422,
    "tests/command_line": 959,
    "tests/data": 149,
    "tests/design": 94,
    "tests/design_check": 60,
    "tests/docs": 327,
    "tests/export": 495,
    "tests/factors": 68,
    "tests/golden": 231,
    "tests/image": 355,
    "tests/in_place": 1182,
    "tests/io": 248,
    "tests/lab": 139,
    "tests/light": 621,
    "tests/lights": 197,
    "tests/long": 1443,
    "tests/measurement": 1929,
    "tests/optics": 494,
    "tests/packaging": 278,
    "tests/radiance": 68,
    "tests/reconstruction": 2230,
    "tests/recording": 236,
    "tests/records": 297,
    "tests/reflectance": 1016,
    "tests/report": 171,
    "tests/response": 117,
    "tests/session": 437,
    "tests/simulation": 623,
    "tests/strangers": 875,
    "tests/studies": 1015,
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
