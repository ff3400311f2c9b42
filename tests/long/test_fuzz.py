"""Many spoilt files of every kind; ``tests/strangers`` reads a few of them each time."""

import subprocess
import sys
from pathlib import Path

COUNT = 2000


def test_every_spoilt_file_is_read_or_refused_in_little_time_and_memory(tmp_path):
    script = Path(__file__).with_name("fuzz.py")
    command = [sys.executable, str(script), str(tmp_path), str(COUNT)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, (tmp_path / "input").read_text() + done.stdout
