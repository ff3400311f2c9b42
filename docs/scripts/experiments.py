"""Measure what the chapters on speed and error state, and write their tables and diagrams.

    python docs/scripts/experiments.py -o OUT SESSION...     measure, then write the chapters
    python docs/scripts/experiments.py -o OUT --write-only   write them from the last run

The sessions are folders with presses of known depth; two virtual sensors are added. What an earlier
run has prepared in OUT (rendered sessions, calibrations, trained networks) is used again. Nothing
else in these chapters is a measured number: a test compares them with the markers of this script.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from chapters import Figures, write

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.design_check.lighting import LightingRow, compare_lighting
from gelpolight_core.experiments.benchmark import benchmark_frame
from gelpolight_core.experiments.front.measure import Point
from gelpolight_core.experiments.front.methods import methods
from gelpolight_core.experiments.front.quiet import Machine, Watch
from gelpolight_core.experiments.front.report import write_work_precision
from gelpolight_core.experiments.front.run import (
    WIDTHS,
    measure_leaving_out,
    measure_sensor,
    prepared,
    sources,
)
from gelpolight_core.experiments.front.scene import session_presses
from gelpolight_core.experiments.integrators.measure import (
    IntegratorPoint,
    measure_integrators,
)
from gelpolight_core.experiments.leave_out import RuleFigure
from gelpolight_core.reconstruction.reconstructor import Reconstructor

MODES = {
    "paper": ("paper", "best"),
    "full, fast": ("full", "fast"),
    "full, balanced": ("full", "balanced"),
    "full, best": ("full", "best"),
}
STEPS_SENSOR = "virtual-matt"


def measure(sessions: Sequence[Path], out: Path, widths: Sequence[int], wait_s: float) -> Figures:
    """Measure everything from seed 0, and keep it in OUT."""
    found = sources(sessions, out)
    for source in found:  # what takes no part in any time
        prepared(source, 0, progress)
    lighting = compare_lighting(SensorDesign(), progress=progress)
    watch = Watch(wait_s, progress)
    steps = measure_steps(next(s for s in found if s.name == STEPS_SENSOR))
    points: list[Point] = []
    rules: list[RuleFigure] = []
    chosen = methods(seed=0)
    for source in found:
        points += measure_sensor(source, chosen, widths=widths, progress=progress)
        rules += measure_leaving_out(source, progress=progress)
    integrators = measure_integrators(progress=progress)
    machine = watch.result()
    figures = Figures(tuple(points), integrators, tuple(rules), lighting, steps, machine)
    write_work_precision(points, integrators, out, rules=rules, machine=machine)
    text = json.dumps(asdict(figures), indent=1, default=float)
    (out / "docs.json").write_text(text, "utf-8")
    return figures


def measure_steps(source: Any) -> dict[str, list[dict[str, Any]]]:
    """Return the steps of a press and of an untouched frame by every mode."""
    session, scene = prepared(source, 0, progress)
    press = session_presses(session)[0].frame
    bare = np.rint(255.0 * session.averaged("background").rgb).astype(np.uint8)
    found = {}
    for name, (model, effort) in MODES.items():
        calibration = scene.paper if model == "paper" else scene.full
        reconstruct = Reconstructor(calibration, model=model, effort=effort)
        result = benchmark_frame(reconstruct, press, repeats=15, plain_repeats=1)
        found[name] = [row.as_dict() for row in (*result.steps, result.total)]
        copy = {"name": "memory copy", "median_ms": result.copy_floor_ms, "p95_ms": 0, "bytes": 0}
        found[name].append(copy)
    reconstruct = Reconstructor(scene.full, effort="fast")
    result = benchmark_frame(reconstruct, bare, repeats=15, plain_repeats=1)
    found["nothing pressed"] = [row.as_dict() for row in (*result.steps, result.total)]
    return found


def read(out: Path) -> Figures:
    """Read the figures of the last run."""
    kept = json.loads((out / "docs.json").read_text("utf-8"))
    return Figures(
        tuple(Point(**row) for row in kept["points"]),
        tuple(IntegratorPoint(**row) for row in kept["integrators"]),
        tuple(RuleFigure(**row) for row in kept["rules"]),
        tuple(LightingRow(**row) for row in kept["lighting"]),
        kept["steps"],
        replace(Machine(**kept["machine"]), busiest=tuple(kept["machine"]["busiest"])),
    )


def progress(what: str, share: float) -> None:
    """Show the progress on one line."""
    sys.stderr.write(f"\r{100 * share:3.0f} %  {what:<70.70}")
    sys.stderr.flush()


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("sessions", type=Path, nargs="*")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--widths", default=",".join(map(str, WIDTHS)))
    parser.add_argument(
        "--wait", type=float, default=120.0, help="longest wait for a quiet machine"
    )
    parser.add_argument("--write-only", action="store_true")
    options = parser.parse_args()
    if options.write_only:
        write(read(options.output))
        return
    widths = [int(part) for part in options.widths.split(",")]
    write(measure(options.sessions, options.output, widths, options.wait))
    sys.stderr.write("\n")


if __name__ == "__main__":
    main()
