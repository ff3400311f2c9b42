"""Every control can be reached and read: no page is cut at any supported size."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from layout_walk import walk

HERE = Path(__file__).parent


def test_nothing_is_cut_on_any_page_at_four_sizes(context):
    assert list(walk(context)) == []


@pytest.mark.long
def test_nothing_is_cut_in_german_at_twice_the_scale(tmp_path):
    environment = {
        **os.environ,
        "QT_SCALE_FACTOR": "2",
        "LANGUAGE": "de",
        "QT_QPA_PLATFORM": "offscreen",
        "PYTHONPATH": os.pathsep.join((str(HERE), str(HERE.parents[1]))),
    }
    done = subprocess.run(
        [sys.executable, str(HERE / "layout_walk.py"), str(tmp_path)],
        env=environment, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["2.0"]
