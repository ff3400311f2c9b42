"""Print what a frame costs for each megapixel, from small cameras to large ones, and its memory.

    python tests/long/scale_figures.py                       0.3, 1.2, 4.9 and 19.7 megapixels
    python tests/long/scale_figures.py --scales 0.5,1 --repeats 30

The virtual sensor is rendered at each size with a 5 mm cylinder pressed into it, and reconstructed
with its exact calibration, in a process of its own so that the memory is that size's alone. Times
are medians over the repeats, after warming up.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import time

from probes import resident_mb

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.simulation.indenters import Cylinder
from gelpolight_core.studies.known_sensor import known_sensor

METHODS = (("paper", "best"), ("full", "fast"), ("full", "balanced"), ("full", "best"))


def measure(scale: float, repeats: int) -> None:
    """Print the figures of one size."""
    known = known_sensor(SensorDesign().scaled(scale))
    frame = known.noisy(known.pressed(Cylinder(5.0, 1.0), samples=1).frame)
    megapixels = frame.shape[0] * frame.shape[1] / 1e6
    for model, effort in METHODS:
        before_mb = resident_mb()
        reconstruct = Reconstructor(known.calibration, model=model, effort=effort)
        times_ms: list[float] = []
        # The first ones compile and fill the buffers.
        for n in range(-2, repeats):
            began = time.perf_counter()
            reconstruct.depth(frame, normals=False)
            if n >= 0:
                times_ms.append(1e3 * (time.perf_counter() - began))
            if n == 0:
                settled_mb = resident_mb()
        took = statistics.median(times_ms)
        print(
            f"{megapixels:6.2f}  {model:5} {effort:8} {took:9.1f} ms  {took / megapixels:7.1f} "
            f"ms/MP  {settled_mb - before_mb:6.0f} MB for it, "
            f"{resident_mb() - settled_mb:+5.0f} MB over the repeats",
            flush=True,
        )


def main() -> None:
    """Measure each size in a process of its own."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scales", default="0.5,1,2,4", help="of the 1280 x 960 camera")
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    for scale in map(float, options.scales.split(",")):
        if options.here:
            measure(scale, options.repeats)
        else:
            again = [sys.executable, __file__, "--here", "--scales", str(scale)]
            subprocess.run([*again, "--repeats", str(options.repeats)], check=True)


if __name__ == "__main__":
    main()
