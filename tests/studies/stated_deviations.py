"""How often the stated expanded uncertainty of a height or size holds the truth.

    python -m tests.studies.stated_deviations

Virtual sensors with other lights, gloss and membranes each are calibrated several times, from
lengths that are stated wrongly by their own tolerances. Balls, cylinders and cuboids with all kinds
of edges are measured with each calibration. Each row compares the deviations (rms) with what is
stated; `between` is the spread of one object over the calibrations of a sensor, which the noise and
the calibration have to explain, and `common` the mean over them, which the model and the fit have.
"""

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.calibration.project import run_calibration
from gelpolight_core.geometry.length_tolerances import INDEX_SD, RADIUS_SD, SQUARE_SD, THICKNESS_SD
from gelpolight_core.measurement.object_measurement import measure_heightmap
from gelpolight_core.measurement.result import compare_with_truth
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.reference_object import ReferenceObject
from gelpolight_core.session.session import read_session
from gelpolight_core.simulation.indenters import BallIndenter, CuboidIndenter, CylinderIndenter
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.simulated_session import pressed_membrane, simulate_session
from gelpolight_core.simulation.virtual_sensor import VirtualSensor
from tests.studies.extreme_sessions import state_wrongly
from tests.studies.presses import show

FILLETS_MM = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8)
TOLERANCES = {
    "thickness": THICKNESS_SD,
    "index": INDEX_SD,
    "top_square": SQUARE_SD,
    "ball_radius": RADIUS_SD,
}


class Compared(NamedTuple):
    """A measured size or height of one object, with one calibration of one sensor."""

    sensor: int
    item: int
    what: str
    quantity: Quantity
    fillet_mm: float


def sensor_of(number: int, scale: float) -> SensorDesign:
    """Return a sensor that differs from the others in all that a maker cannot repeat."""
    rng, made = np.random.default_rng([38, number]), SensorDesign()
    moved = rng.normal(0.0, 0.3, (3, 3))
    leds = [
        replace(led, x_mm=led.x_mm + x, y_mm=led.y_mm + y, height_mm=led.height_mm + 0.3 * z)
        for led, (x, y, z) in zip(made.leds, moved, strict=True)
    ]
    membrane = replace(
        made.membrane,
        specular_weight=rng.uniform(0.0, 0.4),
        decay_length_mm=rng.uniform(0.55, 0.85),
    )
    return replace(made, leds=tuple(leds), membrane=membrane, presses=()).scaled(scale)


def measured(
    number: int, folder: Path, calibrations: int, items: int, scale: float
) -> Iterator[Compared]:
    """Yield sizes and heights of objects, each measured with each calibration of a sensor."""
    design = sensor_of(number, scale)
    simulate_session(design, folder, seed=number)
    sensor, rng = VirtualSensor(design, number), np.random.default_rng([39, number])
    description, lengths = (folder / "session.toml").read_text(), rng.normal(size=(calibrations, 4))
    for turn, wrong in enumerate(lengths):
        (folder / "session.toml").write_text(description)
        for (key, sd), by in zip(TOLERANCES.items(), wrong, strict=True):
            state_wrongly(key, 100.0 * sd * by, folder)
        reconstructor = Reconstructor(run_calibration(read_session(folder)).calibration)
        for item in range(items):
            own = np.random.default_rng([40, number, item])
            shape, fillet = ("cylinder", "cuboid", "ball")[item % 3], own.choice(FILLETS_MM)
            size, depth = own.uniform(3.0, 7.0), own.uniform(0.4, 1.4)
            if shape == "ball":
                indenter, fillet = BallIndenter(size / 2.0, min(depth, 0.22 * size)), 0.0
            else:
                indenter = (CylinderIndenter if shape == "cylinder" else CuboidIndenter)(
                    size, depth, fillet
                )
            x, y, yaw = own.uniform([-3.0, -3.0, -45.0], [3.0, 3.0, 45.0]).tolist()
            state = pressed_membrane(design, indenter, x_mm=x, y_mm=y, yaw_deg=yaw)
            frame = sensor.frame(state, stream=f"{item} {turn}")
            found = measure_heightmap(reconstructor.depth(frame, uncertainty=True), shape=shape)
            for quantity in compare_with_truth(
                found, ReferenceObject(shape, size, height_mm=indenter.depth_mm)
            ):
                what = f"{shape} {'height' if 'height' in quantity.name else 'size'}"
                yield Compared(number, item, what, quantity, fillet)


def row(what: str, found: list[Compared]) -> dict[str, Any]:
    """Return how often U holds the truth, and deviations beside what is stated, in um."""
    error, sd = np.array([(c.quantity.error, c.quantity.sd) for c in found]).T

    def rms(values: Any) -> float:
        return 1e3 * float(np.sqrt(np.mean(np.square(values))))

    groups: dict[tuple[int, int, str], list[float]] = {}
    for c in found:
        groups.setdefault((c.sensor, c.item, c.what), []).append(c.quantity.error or 0.0)
    parts = [dict(c.quantity.budget) for c in found]
    return {
        "what": what,
        "n": len(found),
        "held %": 100.0 * float(np.mean(np.abs(error) <= 2.0 * sd)),
        "rms/sd": 1e-3 * rms(error / sd),
        "deviation um": rms(error),
        "sd um": rms(sd),
        "between um": rms([np.std(e, ddof=1) for e in groups.values()]),
        "common um": rms([np.mean(e) for e in groups.values()]),
        **{f"{key} um": rms([part[key] for part in parts]) for key in parts[0]},
    }


def table(found: list[Compared]) -> list[dict[str, Any]]:
    """Return a row for each shape and length, for each fillet, and for all."""
    rows = [row(what, [c for c in found if c.what == what]) for what in {c.what: 0 for c in found}]
    for fillet in FILLETS_MM:
        of = [c for c in found if c.fillet_mm == fillet and "size" in c.what and "b" != c.what[0]]
        rows += [row(f"edge {fillet:g} size", of)] if of else []
    return [*rows, row("all", found)]


if __name__ == "__main__":
    every: list[Compared] = []
    for number in range(6):
        with tempfile.TemporaryDirectory() as temporary:
            every += measured(number, Path(temporary) / "session", 6, 14, 0.5)
        print(f"sensor {number}", file=sys.stderr, flush=True)
    show(table(every))
