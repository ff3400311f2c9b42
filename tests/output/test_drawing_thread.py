"""Drawings are made one at a time, and do not open a font for each calling thread."""

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
from matplotlib import rcParams
from matplotlib.figure import Figure

from gelpolight_core.output.drawing_thread import THREAD_NAME, in_drawing_thread
from gelpolight_core.output.report.drawing_tools import drawing


@drawing(20.0)
def words(figure: Figure) -> str:
    figure.text(0.1, 0.5, "height (mm)", fontweight="bold")
    return "words"


def test_drawings_asked_for_at_once_are_made_one_after_the_other():
    style = dict(rcParams)
    meeting = threading.Barrier(3)
    drawn: list[str] = []

    def ask() -> None:
        meeting.wait()
        drawn.append(words().svg)

    with ThreadPoolExecutor(3) as people:
        for asked in [people.submit(ask) for _ in range(3)]:
            asked.result()
    assert len(set(drawn)) == 1
    assert dict(rcParams) == style


def test_a_drawing_within_a_drawing_and_its_errors_come_to_the_caller():
    @in_drawing_thread
    def inner(name: str) -> str:
        if not name:
            raise ValueError("without a name")
        return f"{threading.current_thread().name.rpartition('_')[0]}: {name}"

    @in_drawing_thread
    def outer(name: str) -> str:
        return inner(name)

    assert outer("spots") == f"{THREAD_NAME}: spots"
    with pytest.raises(ValueError, match="without a name"):
        outer("")
