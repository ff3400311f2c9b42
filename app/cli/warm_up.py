"""Prepares the virtual sensor, and compiles what the program needs, before somebody waits for it.

A loop is compiled when it is first called, for the types of its arguments. So all that is done
here with virtual sensors is what a person does: images, calibrations, depth, sizes.
``python -m app.cli.warm_up`` is a part of the set-up. It is quick when nothing has changed.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import re
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from importlib.metadata import version
from pathlib import Path

import llvmlite.binding

from app.program.prepare import prepare, virtual_design

STAMP = "gelpolight-compiled"
_LOOP = re.compile(rb"^ *@(compiling\.)?_?(whole|part|compiled)\b", re.MULTILINE)


def compile_loops(say: Callable[[str], object]) -> bool:
    """Compile all loops, unless that was done for these sources, libraries and this processor.

    The virtual sensor is prepared on the way, which compiles most of them.

    Parameters
    ----------
    say : callable
        Called with a line for each step.

    Returns
    -------
    bool
        Whether there was anything to do.
    """
    # Where numba looks first for what it kept.
    cache_folder = os.environ.get("NUMBA_CACHE_DIR")
    cache = Path(cache_folder) if cache_folder else Path(__file__).with_name("__pycache__")
    stamp, state = cache / STAMP, _state()
    if stamp.is_file() and stamp.read_text() == state:
        return False
    cache.mkdir(parents=True, exist_ok=True)
    # They share few loops, and there are two cores nearly everywhere.
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        closed = pool.submit(use_closed_sensor)
        sensor = prepare(say=say, again=True)
        say("Compiling depth and sizes")
        use_open_sensor(sensor)
        say("Compiling what closed sensors need")
        closed.result()
    stamp.write_text(state)
    return True


def _state() -> str:
    """Return a hash of what decides whether compiled loops can be used."""
    name = llvmlite.binding.get_host_cpu_name()
    digest = hashlib.sha256(f"{version('numba')} {sys.version} {name}".encode())
    root = Path(__file__).resolve().parents[2]
    for package in ("app", "gelpolight_core"):
        for path in sorted((root / package).rglob("*.py")):
            if _LOOP.search(source := path.read_bytes()) or path == Path(__file__):
                digest.update(source)
    return digest.hexdigest()


def use_open_sensor(path: Path) -> None:
    """Reconstruct and measure a press on the virtual sensor as the window and the commands do."""
    import numpy as np  # slow imports

    from app.sources.virtual_bench import VirtualBench
    from app.sources.virtual_source import VirtualSource
    from app.views.map import shading
    from gelpolight_core.calibration.calibration_file import read_calibration
    from gelpolight_core.measurement.object_measurement import AUTO, measure_heightmap
    from gelpolight_core.output.recording.recording_format import RecordingHeader
    from gelpolight_core.output.recording.recording_reader import Recording
    from gelpolight_core.output.recording.recording_writer import RecordingWriter
    from gelpolight_core.reconstruction.reconstructor import Reconstructor
    from gelpolight_core.reconstruction.trace import EFFORTS

    bench = VirtualBench(virtual_design())
    bench.place_object("cylinder")
    source = VirtualSource(bench)
    source.open()
    while (frame := source.frame(1.0)) is None or not frame.settled:
        pass
    source.close()
    calibration = read_calibration(path)
    # A camera gives whole numbers, commands linear light.
    for image in (frame.rgb, (frame.rgb / 255.0).astype(np.float32)):
        for effort in EFFORTS:
            reconstructor = Reconstructor(calibration, effort=effort)
            reconstructor.depth(image)
        measure_heightmap(reconstructor.depth(image, uncertainty=True), shape=AUTO)
        Reconstructor(calibration, model="paper").depth(image)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "press.gplrec")
        with RecordingWriter(file, RecordingHeader()) as recording:
            recording.append(frame.rgb, 0, 0.0)
        with Recording.open(file) as opened:
            opened.frame(0)
    shading.warm_up()


def use_closed_sensor() -> None:
    """Calibrate and use a closed virtual sensor, of a quarter of the size."""
    import numpy as np  # slow imports

    from gelpolight_core.calibration.project import run_calibration
    from gelpolight_core.reconstruction.reconstructor import Reconstructor
    from gelpolight_core.session.session import read_session
    from gelpolight_core.session.session_images import read_colours
    from gelpolight_core.simulation.sensor_design import SensorDesign
    from gelpolight_core.simulation.simulated_session import simulate_session

    with tempfile.TemporaryDirectory() as folder:
        session = Path(folder, "closed")
        simulate_session(SensorDesign(), session, scale=0.25, closed=True)
        linear = read_colours(next(session.glob("presses/*.png"))).rgb
        reconstructor = Reconstructor(run_calibration(read_session(session)).calibration)
        for image in (np.round(255.0 * linear).astype(np.uint8), linear):
            reconstructor.depth(image)


if __name__ == "__main__":
    say = partial(print, flush=True)
    if not compile_loops(say):
        prepare(say=say)
