"""Print what a frame costs and how accurate it is, for every mode, beside a copy of its bytes.

    python tests/long/solver_figures.py SENSOR.gplcal SESSION
    python tests/long/solver_figures.py SENSOR.gplcal SESSION --repeats 30 --skip accuracy

SESSION holds ``background/``, ``presses/`` with ``truth.csv``, and ``truth/``. All modes are timed
in turn, frame by frame, so that a slow spell of the machine meets all alike. Times are medians and
minima.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.measurement.score import read_true_depth, score_depth
from gelpolight_core.measurement.truth import read_truth
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.images import read_image

PRESS = "cylinder_s5_d100.png"
MODES = (("paper", "best"), ("full", "fast"), ("full", "balanced"), ("full", "best"))


def raw_frame(path: Path) -> np.ndarray:
    """Return an image in 8 bits."""
    rgb = read_image(path).rgb
    return np.asarray(np.round(rgb * 255.0), np.uint8) if rgb.dtype.kind == "f" else rgb


def print_times(calibration_path: Path, session: Path, repeats: int) -> None:
    """Time every mode on a press, and on the bare membrane."""
    calibration = read_calibration(calibration_path)
    press = raw_frame(session / "presses" / PRESS)
    bare = raw_frame(next((session / "background").glob("*.png")))
    table = calibration.table
    must = press.nbytes + 3 * table.u_px.nbytes + calibration.radiance.nbytes
    source, target = np.ones(must // 2, np.uint8), np.empty(must // 2, np.uint8)
    actions: dict[str, Callable[[], object]] = {"copy": lambda: np.copyto(target, source)}
    for model, effort in MODES:
        reconstruct = Reconstructor(calibration, model=model, effort=effort)
        actions[f"{model} {effort}"] = lambda r=reconstruct: r.depth(press, normals=False)
        if model == "full":
            actions[f"{model} {effort}, nothing pressed"] = lambda r=reconstruct: r.depth(
                bare, normals=False
            )
    best = Reconstructor(calibration, effort="best")
    actions["full best with uncertainty"] = lambda: best.depth(
        press, normals=False, uncertainty=True
    )
    times: dict[str, list[float]] = {name: [] for name in actions}
    for turn in range(-1, repeats):
        for name, action in actions.items():
            if len(times[name]) > 5 and times[name][0] > 400.0:
                continue
            began = time.perf_counter()
            action()
            if turn >= 0:
                times[name].append(1e3 * (time.perf_counter() - began))
    copy = float(np.median(times["copy"]))
    for name, taken in times.items():
        took = float(np.median(taken))
        print(f"{name:36} {took:9.2f} ms  min {min(taken):9.2f}  {took / copy:8.1f} copies")


def print_errors(calibration_path: Path, session: Path) -> None:
    """Score every mode on all presses with truth."""
    calibration = read_calibration(calibration_path)
    rows = read_truth(session / "presses" / "truth.csv").rows
    for model, effort in MODES:
        reconstruct = Reconstructor(calibration, model=model, effort=effort)
        scores = []
        for row in rows:
            truth = read_true_depth(session / "truth" / f"{Path(row.file).stem}.npz")
            found = reconstruct.depth(raw_frame(session / "presses" / row.file), normals=False)
            scores.append(
                score_depth(
                    found.depth_mm,
                    found.x_mm,
                    found.y_mm,
                    truth,
                    height_mm=row.truth.height_mm,
                    radius_mm=12.0,
                )
            )
        errors = np.array([[s.height_percent, s.size_percent, s.rms_um] for s in scores])
        height, size, rms = np.abs(errors).mean(axis=0)
        print(f"{model} {effort:10} height {height:6.3f} %  size {size:6.3f} %  {rms:6.2f} um")
        print("   ", "  ".join(f"{e[0]:+.2f}/{e[1]:+.2f}/{e[2]:.1f}" for e in errors))


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("calibration", type=Path)
    parser.add_argument("session", type=Path)
    parser.add_argument("--repeats", type=int, default=30)
    parser.add_argument("--skip", choices=("times", "accuracy"), default="")
    options = parser.parse_args()
    if options.skip != "times":
        print_times(options.calibration, options.session, options.repeats)
    if options.skip != "accuracy":
        print_errors(options.calibration, options.session)


if __name__ == "__main__":
    main()
