"""Compiles what the program needs before somebody waits for it; for a set-up.

A loop is compiled when it is first called, for the types of its arguments. So all that is done
here with a small virtual sensor is what a person does: images, calibrations, depth, sizes.
"""

from __future__ import annotations

import hashlib
import os
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import llvmlite.binding

SCALE, BALLS = 0.25, 6
"""The smallest images, and the fewest balls, with which every stage of an open sensor works."""
PRESS = "presses/cylinder_s5_d100.png"
STEPS = 8
STAMP = "gelpolight-compiled"
_LOOP = re.compile(rb"^ *@(compiling\.)?_?(whole|part|compiled)\b", re.MULTILINE)


def compile_loops(progress: Callable[[str, int, int], None]) -> bool:
    """Compile all loops, unless that was done for these sources, libraries and this processor.

    Parameters
    ----------
    progress : callable
        Called with what is compiled next, its number from 1 on, and how many there are.

    Returns
    -------
    bool
        Whether there was anything to do.
    """
    # Where numba looks first for what it kept.
    named = os.environ.get("NUMBA_CACHE_DIR")
    kept = Path(named) if named else Path(__file__).with_name("__pycache__")
    stamp, state = kept / STAMP, _state()
    if stamp.is_file() and stamp.read_text() == state:
        return False
    kept.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for title, number in zip(_steps(Path(folder)), range(1, STEPS + 1), strict=True):
            progress(title, number, STEPS)
    stamp.write_text(state)
    return True


def _state() -> str:
    """Return a hash of what decides whether compiled loops can be used."""
    name = llvmlite.binding.get_host_cpu_name()
    found = hashlib.sha256(f"{version('numba')} {sys.version} {name}".encode())
    root = Path(__file__).resolve().parents[1]
    for package in ("app", "gelpolight_core"):
        for path in sorted((root / package).rglob("*.py")):
            if _LOOP.search(source := path.read_bytes()) or path == Path(__file__):
                found.update(source)
    return found.hexdigest()


def _steps(folder: Path) -> Iterator[str]:
    """Do one thing after the other, each after its title was taken."""
    import numpy as np  # slow imports

    from app.view2d import shading
    from gelpolight_core.calibration.project import calibrate
    from gelpolight_core.design.sensor_design import SensorDesign
    from gelpolight_core.measurement.indenter_tools import AUTO, measure_heightmap
    from gelpolight_core.reconstruction.reconstructor import Reconstructor
    from gelpolight_core.reconstruction.trace import EFFORTS
    from gelpolight_core.recording.reader import Recording
    from gelpolight_core.recording.recording import RecordingHeader
    from gelpolight_core.recording.writer import RecordingWriter
    from gelpolight_core.session.images import read_colours
    from gelpolight_core.session.session import read_session
    from gelpolight_core.simulation.session import simulate_session

    design = SensorDesign()
    yield "the virtual sensor"
    opened = replace(design, balls=design.balls[:BALLS])
    simulate_session(opened, folder / "open", scale=SCALE)
    yield "the calibration of an open sensor"
    calibration = calibrate(read_session(folder / "open")).calibration
    # Commands give linear light, a camera whole numbers.
    linear = read_colours(folder / "open" / PRESS).rgb
    seen = np.round(255.0 * linear).astype(np.uint8)
    for effort in EFFORTS:
        yield f"depth, effort {effort}"
        reconstructor = Reconstructor(calibration, effort=effort)
        for frame in (seen, linear):
            reconstructor.depth(frame)
    yield "sizes, and the model of the paper"
    for frame in (seen, linear):
        measure_heightmap(reconstructor.depth(frame, uncertainty=True), shape=AUTO)
        Reconstructor(calibration, model="paper").depth(frame)
    yield "the closed sensor"
    simulate_session(design, folder / "closed", scale=SCALE, closed=True)
    closed = calibrate(read_session(folder / "closed")).calibration
    for frame in (seen, linear):
        Reconstructor(closed).depth(frame)
    yield "recordings and views"
    with RecordingWriter(folder / "press.gplrec", RecordingHeader()) as recording:
        recording.append(seen, 0, 0.0)
    with Recording.open(folder / "press.gplrec") as opened_again:
        opened_again.frame(0)
    shading.warm_up()
