"""What the program gives for four sensors, recorded: any change of it is seen, and has a reason.

Record again what is meant to change, in a commit of its own that says why::

    python tests/golden/golden_outputs.py [rendered] [glossy] [closed] [mini-1]

Of each sensor, ``outputs/NAME.json`` holds one value per line: the calibration's figures with their
verdicts, the stages' states, ``measure --json`` of a press by each model, the tables of
``evaluate``, and the entries of the npz files of ``reconstruct``; ``outputs/NAME.npz`` holds the
depth of every STEP-th node in units of 0.01 um, and every node's flags, for every model and effort.
Nothing of ``../shared`` is copied.
"""

import csv
import ctypes
import json
import math
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numba.core.registry import cpu_target

from app.cli.main import main as gelpolight
from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.simulated_session import simulate_session

HERE = Path(__file__).parent / "outputs"
SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"

STEP = 4
UNIT_MM = 1e-5
"""Depth is recorded and compared in units of 0.01 um."""


def linear_algebra() -> str:
    """Return the kernel and the threads of NumPy's library, which decide its order of adding."""
    found = list(Path(np.__file__).parents[1].glob("numpy.libs/libscipy_openblas64_*"))
    if not found:
        return "another library"
    library = ctypes.CDLL(str(found[0]))
    name = library.scipy_openblas_get_corename64_
    name.restype = ctypes.c_char_p
    return f"{name().decode()} {library.scipy_openblas_get_num_threads64_()}"


PROCESSOR = " ".join(
    (cpu_target.target_context.codegen().magic_tuple()[1], linear_algebra(), *platform.libc_ver())
)
"""Loops are compiled for it, and it chooses the kernel of the linear algebra library (the number
behind it: of its threads). Any of them changes in which order numbers are added; another C library
has other last digits of its functions."""


@dataclass(frozen=True)
class Tolerance:
    """What may differ: values by the larger of two, depth in its units, the share of flags."""

    relative: float
    absolute: float
    absolute_percent: float
    depth: int
    flags: float


SAME_PROCESSOR = Tolerance(1e-4, 1e-8, 1e-8, 2, 0.0)
"""Values repeat exactly; 1e-4 lets sums change their order. Depth: two rounded values."""
OTHER_PROCESSOR = Tolerance(0.02, 0.004, 0.1, 100, 1e-4)
"""With loops for Haswell and libraries without AVX2, this set differed by up to 0.5 % or 0.0012 mm,
0.022 %, 0.4 um of depth and one flag of 73728; with loops for znver3 and the kernel for Haswell, by
up to 1.7 % (the slope error of mini-1), 0.0033 mm (an edge radius, which the depths hardly decide)
and the 0.081 % of a size that follow from it. For a closer comparison, record the outputs of the
commit before on the same machine."""

OWN = ("id", "calibration_id", "calibration", "format", "version", "sha256")
"""Keys whose values follow from the exact bits of a calibration, or name the form of a file."""
COMPARISONS = ("expanded_mm", "en", "decision")
RATIOS = (
    "errors",
    "characteristics",
    "comparisons",
    "ball_sizes_percent",
    *(f"{direction}_{what}" for direction in ("planar", "depth") for what in COMPARISONS),
)
"""Keys of small differences of recorded numbers, which another processor changes by more than it
changes those."""
TEXTS = ("/label", "/advice", "/reason")
"""Texts for people, whose wording is not recorded, as that of any text with a space."""

PRESSES = ("cylinder_s5_d100", "cuboid_s4_d100")
KEPT = {
    "presses": PRESSES,
    "balls": ("ball_00", "ball_03", "ball_06", "ball_09"),
    "checkerboard": tuple(f"view_{number:02}" for number in range(8)),
}
OPEN_MODES = {
    "paper": ["--model", "paper"],
    "fast": ["--model", "full", "--effort", "fast"],
    "balanced": ["--model", "full", "--effort", "balanced"],
    "best": ["--model", "full", "--effort", "best"],
}
IN_PLACE = {"in-place": ["--model", "in-place"]}

Values = dict[str, Any]
Maps = dict[str, np.ndarray]


def rendered(folder: Path) -> None:
    """Write the session of sensor-A at a quarter of its size, with some of its images."""
    for path in sorted((SHARED / "sensor-A").glob("*/*.png")):
        if path.stem not in KEPT.get(path.parent.name, path.stem):
            continue
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        (folder / path.parent.name).mkdir(parents=True, exist_ok=True)
        small = cv2.resize(image, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(folder / path.parent.name / path.name), small)
    shutil.copy(SHARED / "sensor-A" / "session.toml", folder)
    rows = (SHARED / "sensor-A" / "presses" / "truth.csv").read_text().splitlines()
    kept = [rows[0], *(row for row in rows if row.startswith(PRESSES))]
    (folder / "presses" / "truth.csv").write_text("\n".join(kept))


def glossy(folder: Path, *, closed: bool = False) -> None:
    """Write a session of the virtual sensor with a glossy membrane, at a quarter of its size."""
    design = SensorDesign()
    design = replace(
        design,
        membrane=replace(design.membrane, specular_weight=0.55, roughness=0.35),
        balls=design.balls if closed else design.balls[:4],  # a closed sensor needs more
        presses=(design.presses[1], design.presses[3]),
    )
    simulate_session(design, folder, scale=0.25, closed=closed)
    for path in (folder / "checkerboard").glob("*.png"):
        if path.stem not in KEPT["checkerboard"]:
            path.unlink()


def closed(folder: Path) -> None:
    """Write the session of the same sensor, closed."""
    glossy(folder, closed=True)


def mini_1(folder: Path) -> None:
    """Write a session with every sixth ball of mini-1, of which two others are the presses."""
    source = SHARED / "real" / "closed" / "mini-1"
    for name in ("background", "balls", "presses"):
        (folder / name).mkdir(parents=True)
    shutil.copy(source / "session.toml", folder)
    for path in (source / "background").iterdir():
        shutil.copy(path, folder / "background")
    balls = sorted((source / "balls").iterdir())
    for path in balls[::6]:
        shutil.copy(path, folder / "balls")
    for path in balls[1:8:6]:
        shutil.copy(path, folder / "presses")


SESSIONS: dict[str, Callable[[Path], None]] = {
    "rendered": rendered,
    "glossy": glossy,
    "closed": closed,
    "mini-1": mini_1,
}
OF_SHARED = ("rendered", "mini-1")


def outputs(name: str, folder: Path) -> tuple[Values, Maps]:
    """Return a sensor's values by their path, and its maps, computed in an empty folder."""
    session, calibration = folder / "session", folder / "sensor.gplcal"
    session.mkdir()
    SESSIONS[name](session)
    found: Values = {"new": states(session)}
    if name != "closed":  # as a script calibrates
        found["calibrate"] = of_json("calibrate", session, "-o", calibration)
    else:  # as the window does
        project = CalibrationProject(session)
        while stale := project.stale():
            project.compute(stale[0])
        found["states"] = {stage: s.state.value for stage, s in project.statuses().items()}
        write_calibration(project.finish().calibration, calibration)
    found["figures"] = {
        stage: {figure.key: [figure.value, figure.verdict.value] for figure in table.figures}
        for stage, table in read_calibration(calibration).quality.items()
    }
    modes = IN_PLACE if name in ("closed", "mini-1") else OPEN_MODES
    images = sorted((session / "presses").glob("*.png"))
    shape = "ball" if name == "mini-1" else "auto"
    maps: Maps = {}
    for mode, options in modes.items():
        run("reconstruct", calibration, *images, "-o", folder / mode, "--format", "npz", *options)
        for image in images:
            with np.load(folder / mode / f"{image.stem}.npz") as data:
                found[f"npz/{mode}/{image.stem}"] = {k: described(k, data[k]) for k in data}
                depth = data["depth_mm"][::STEP, ::STEP].astype(float)
                maps[f"{mode}/{image.stem}/depth"] = np.rint(depth / UNIT_MM).astype(np.int32)
                maps[f"{mode}/{image.stem}/flags"] = data["flags"]
    for model in dict.fromkeys(options[1] for options in modes.values()):
        found[f"measure/{model}"] = of_json(
            "measure", calibration, images[0], "--shape", shape, "--model", model
        )
    if name != "mini-1":  # nobody knows how deep its balls were pressed
        table = folder / "evaluate"
        run("evaluate", calibration, session / "presses", "-o", table)
        with (table / "evaluation.csv").open() as stream:
            found["evaluate/csv"] = list(csv.DictReader(stream))
        found["evaluate/json"] = json.loads((table / "evaluation.json").read_text())
    return dict(flat(found)), maps


def run(*words: object) -> None:
    """Run a command of the program, which must succeed."""
    assert gelpolight([str(word) for word in words]) == 0, words


def of_json(*words: object) -> Any:
    """Run a command with --json and return what it wrote."""
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "result.json"
        run(*words, "--json", path)
        return json.loads(path.read_text())


def states(session: Path) -> Values:
    """Return the states of the stages of a session that was just opened."""
    return {stage: s.state.value for stage, s in CalibrationProject(session).statuses().items()}


def described(key: str, array: np.ndarray) -> Values:
    """Return the form of an entry of an npz file, with the values of a short one."""
    form = {"dtype": array.dtype.kind, "shape": list(array.shape)}
    return form | {"values": array.ravel().tolist()} if array.size < 10 else form


def flat(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the path and value of every leaf; of texts for people, only that there is one."""
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, part in items:
            if key not in (*OWN, *RATIOS):
                yield from flat(part, f"{path}/{key}" if path else str(key))
    elif isinstance(value, str):
        sentence = value and path.endswith(TEXTS)
        yield path, "(text)" if sentence or " " in value else number(value)
    else:
        yield path, number(value) if isinstance(value, float) else value


def number(value: Any) -> Any:
    """Return a number, also one from a CSV file, to 8 digits, or what is no number as it is."""
    try:
        rounded = float(f"{float(value):.8g}")
    except ValueError:
        return value
    return rounded if math.isfinite(rounded) else str(rounded)  # nan is not equal to itself


def differences(name: str, values: Values, maps: Maps) -> list[str]:
    """Return a line for each value or map that differs from what was recorded."""
    known: Values = json.loads((HERE / f"{name}.json").read_text())
    allowed = SAME_PROCESSOR if known.pop("processor") == PROCESSOR else OTHER_PROCESSOR
    lines = [
        f"{name}: {key}: recorded {known.get(key, 'nothing')}, now {values.get(key, 'nothing')}"
        for key in sorted(known.keys() | values.keys())
        if key not in known
        or key not in values
        or not same(known[key], values[key], allowed, percent=_in_percent(key, known))
    ]
    with np.load(HERE / f"{name}.npz") as recorded:
        for key in sorted(recorded.keys() | maps.keys()):
            if key not in maps or key not in recorded or maps[key].shape != recorded[key].shape:
                lines.append(f"{name}: {key}: not the same maps or sizes as recorded")
                continue
            off = np.abs(maps[key].astype(int) - recorded[key].astype(int))
            wrong = off > (allowed.depth if key.endswith("depth") else 0)
            if wrong.mean() > (0.0 if key.endswith("depth") else allowed.flags):
                at = np.unravel_index(off.argmax(), off.shape)
                lines.append(
                    f"{name}: {key}: {wrong.sum()} of {off.size} nodes differ, most at "
                    f"{tuple(map(int, at))}: recorded {recorded[key][at]}, now {maps[key][at]}"
                )
    return lines


def _in_percent(key: str, known: Values) -> bool:
    """Return whether a value is a percentage, by its name or by the unit of its figure."""
    return "percent" in key or known.get(f"{key.rpartition('/')[0]}/unit") == "%"


def same(known: Any, value: Any, allowed: Tolerance, *, percent: bool) -> bool:
    """Return whether a value is the recorded one, numbers within the tolerance."""
    if isinstance(known, float) and isinstance(value, int | float):
        absolute = allowed.absolute_percent if percent else allowed.absolute
        return math.isclose(known, value, rel_tol=allowed.relative, abs_tol=absolute)
    return bool(known == value)


def record(name: str) -> None:
    """Write the outputs of a sensor as they are now."""
    with tempfile.TemporaryDirectory() as scratch:
        values, maps = outputs(name, Path(scratch))
    HERE.mkdir(exist_ok=True)
    values["processor"] = PROCESSOR
    text = json.dumps(values, indent=0, sort_keys=True, ensure_ascii=False)
    (HERE / f"{name}.json").write_text(text + "\n", encoding="utf-8")
    np.savez_compressed(HERE / f"{name}.npz", **maps)


if __name__ == "__main__":
    for given in sys.argv[1:] or SESSIONS:
        record(given)
