"""The leak check of the tests' conftest can fail, and names the remaining objects."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest_plugins = ["pytester"]

CONFTEST = Path(__file__).resolve().parents[1] / "conftest.py"
ROOT = CONFTEST.parents[2]
LEAKS = {
    "timer": (
        "from PySide6.QtCore import QTimer\nKEPT = []\n",
        "    timer = QTimer()\n    timer.start(1000)\n    KEPT.append(timer)\n",
        "timer started at*timer.start(1000)",
    ),
    "thread": (
        "import threading\nEND = threading.Event()\n",
        "    threading.Thread(target=END.wait, args=(5,), name='left-on', daemon=True).start()\n",
        "thread left-on",
    ),
    "window": (
        "from PySide6.QtWidgets import QWidget\nKEPT = []\n",
        "    w = QWidget()\n    w.setObjectName('lost')\n    w.show()\n    KEPT.append(w)\n",
        "window QWidget 'lost'",
    ),
}


def test_what_is_left_behind_is_named(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    pytester.makeconftest(CONFTEST.read_text("utf-8") + "\nGRACE_S = 0.2\n")
    for kind, (above, inside, _) in LEAKS.items():
        tests = f"def test_{kind}():\n{inside}\ndef test_after_{kind}():\n    pass\n"
        pytester.makepyfile(**{f"test_{kind}": f"{above}\n{tests}"})
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider", "-p", "no:xvfb")
    result.assert_outcomes(passed=2 * len(LEAKS), errors=len(LEAKS))
    for kind, (_, _, output) in LEAKS.items():
        result.stdout.fnmatch_lines([f"*ERROR at teardown of test_{kind} *"])
        result.stdout.fnmatch_lines([f"*left behind: *{output}*"])
