"""The program can be used for a long time: it does not grow, slow down, hang or fail."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
from scipy.stats import theilslopes

from gelpolight_core.calibration.calibration_file import write_calibration

MINUTES = 20.0
# What is loaded, compiled and cached late.
WARM_UP = 0.2
MOST_GROWTH_MB_PER_H = 30.0
LEAST_RATE = 0.9


def test_a_person_who_uses_everything_meets_no_leak_hang_or_error(small_calibration, tmp_path):
    write_calibration(small_calibration, tmp_path / "sensor.gplcal")
    script = Path(__file__).with_name("soak.py")
    command = [sys.executable, str(script), str(tmp_path), str(MINUTES), "0"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240.0 * MINUTES)
    hung, actions = ((tmp_path / name).read_text() for name in ("hung.log", "actions.log"))
    assert (done.returncode, hung) == (0, ""), done.stderr + actions[-2000:]
    found = json.loads((tmp_path / "rests.json").read_text())
    assert found["errors"] == [], actions[-2000:]
    rows = np.array(found["rows"])
    minutes, memory_mb, shown_hz = rows[rows[:, 0] > WARM_UP * MINUTES, :3].T
    # Not even the lower end of the slope's 95 % interval may be a leak.
    assert theilslopes(memory_mb, minutes / 60.0, 0.95)[2] < MOST_GROWTH_MB_PER_H
    first, *_, last = (np.median(part) for part in np.array_split(shown_hz, 3))
    assert last > LEAST_RATE * first > 0.0
