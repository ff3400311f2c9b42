"""Inputs that no sensor gives: number types of an image, changed calibrations, and threads.

    python -m tests.studies.extreme_inputs

Each must be reconstructed correctly, or be refused with its reason.
"""

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
from gelpolight_core.geometry.sensor_frame import TopPlane
from gelpolight_core.light.reflectance_table import ReflectanceTable
from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor.sensor_calibration import MODELS, Calibration
from gelpolight_core.studies.exact_sensor import ExactSensor
from gelpolight_core.studies.extreme_presses import SPOILT_UM, ImageModifier, on_image
from gelpolight_core.studies.image_case_helpers import (
    is_finite,
    measure_all_modes,
    rms_um,
    standard_press,
    standard_sensor,
)
from gelpolight_core.studies.stability import (
    Case,
    CaseMeasurement,
    ModeResult,
    cases_of,
    run_case,
)
from gelpolight_core.studies.stability_cases import CaseRun, rows


def single_measurement(right: bool, summary: str) -> CaseMeasurement:
    """Return the measurement of a case without modes."""
    return CaseMeasurement(summary, (ModeResult("", right),))


CalibrationModifier = Callable[[Calibration], Calibration]


def number_type(change: ImageModifier) -> CaseMeasurement:
    """Reconstruct another number type, which must give the usual depth."""
    # Effect of the skipped field beside a contact, root mean square.
    result = on_image(change, 2.0)
    solver, frame = Reconstructor(standard_sensor().calibration), standard_press().frame
    difference = solver.depth(change(frame)).depth_mm - solver.depth(frame).depth_mm
    difference_um = rms_um(difference.astype(np.float64))
    summary = f"{result.summary}; {difference_um:.2f} um from the usual number type"
    same = difference_um < 1.0
    modes = tuple(replace(mode, right=mode.right and same) for mode in result.modes)
    return replace(result, summary=summary, modes=modes)


def on_calibration(change: CalibrationModifier, needs: Sequence[Flag] = ()) -> CaseMeasurement:
    """Reconstruct the standard press by a changed calibration."""
    standard = standard_sensor()
    changed = ExactSensor(standard.sensor, change(standard.calibration))
    return measure_all_modes(changed, standard_press(), SPOILT_UM, needs=needs)


def hole(field: str, calibration: Calibration) -> Calibration:
    """Return a calibration without light and without a field over 1 mm."""
    full = calibration.open_sensor.full
    assert full is not None
    x, y = np.meshgrid(calibration.table.grid.x_mm, calibration.table.grid.y_mm)
    kept_mask = (np.hypot(x + 6.0, y) >= 0.5)[..., None]
    full = replace(full, background=full.background * kept_mask)
    return calibration.changed(full=full, **{field: getattr(calibration.data, field) * kept_mask})


def leds_above(calibration: Calibration) -> Calibration:
    """Return a calibration whose LEDs are on the outer side of the membrane."""
    sensor = calibration.open_sensor
    assert sensor.full is not None
    leds = sensor.led_positions_mm * np.array([1.0, 1.0, -1.0])
    full = replace(sensor.full, led_positions_mm=leds)
    return calibration.changed(led_positions_mm=leds, full=full)


def with_curve(factor: float, step: int, calibration: Calibration) -> Calibration:
    """Return a calibration with the first reflectance curve, changed, for all channels."""
    table = calibration.open_sensor.reflectance
    values = factor * table.values[0][::step]
    three = ReflectanceTable(table.cosines, (values, values, values), table.coverage)
    return calibration.changed(reflectance=three)


def read(change: CalibrationModifier) -> CaseMeasurement:
    """Write a changed calibration and read it again, which must be refused."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "changed.gplcal"
        write_calibration(change(standard_sensor().calibration), path)
        read_calibration(path)
    return single_measurement(False, "it was read without an error")


def repeated(model: str, threads: tuple[int, ...]) -> CaseMeasurement:
    """Reconstruct repeatedly, by numbers of threads."""
    calibration, frame = standard_sensor().calibration, standard_press().frame
    first, *maps = (
        Reconstructor(calibration, model=model, workers=n).depth(frame) for n in threads
    )
    same = all(np.array_equal(first.flags, other.flags) for other in maps)
    difference_mm = max(float(np.abs(other.depth_mm - first.depth_mm).max()) for other in maps)
    return single_measurement(
        same and difference_mm == 0.0, f"up to {1e3 * difference_mm:.2g} um apart"
    )


def beyond_curve() -> CaseMeasurement:
    """Take a table whose brightest value is below what the image shows."""
    calibration = standard_sensor().calibration.changed(full=None)
    low = replace(with_curve(0.5, 1, calibration), model="paper")
    result = Reconstructor(low).depth(standard_press().frame)
    deepest = float(np.abs(result.depth_mm).max())
    keys = ", ".join(finding.key for finding in result.findings)
    named = is_finite(result) and "exposure" in keys
    return single_measurement(named, f"{keys}; at most {deepest:.1f} mm")


def plane_behind(calibration: Calibration) -> Calibration:
    plane = TopPlane((0, 0, -1), calibration.open_sensor.plane.distance_mm)
    return calibration.changed(plane=plane)


def times(field: str, factor: float, calibration: Calibration) -> Calibration:
    return calibration.changed(**{field: factor * getattr(calibration.open_sensor, field)})


TABLE: dict[tuple[str, str], dict[str, CaseRun]] = {
    ("images", "a number type: the same depth, or an error that names it"): rows(
        number_type,
        {
            "kind_uint8": lambda f: np.rint(f * 255).astype(np.uint8),
            "kind_uint16": lambda f: np.rint(f * 65535).astype(np.uint16),
            "kind_uint16_other_byte_order": lambda f: np.rint(f * 65535).astype(">u2"),
            "kind_float16": lambda f: f.astype(np.float16),
            "kind_float32_other_byte_order": lambda f: f.astype(">f4"),
            "kind_float64": lambda f: f.astype(np.float64),
            "kind_int8": lambda f: (f * 127).astype(np.int8),
            "kind_int32": lambda f: (f * 255).astype(np.int32),
            "kind_bool": lambda f: f > 0.3,
            "kind_complex": lambda f: f.astype(np.complex128),
            "kind_text": lambda f: f.astype(np.str_),
            "kind_grey": lambda f: f[..., 0],
            "kind_four_channels": lambda f: np.concatenate([f, f[..., :1]], axis=-1),
            "kind_empty": lambda f: f[:0],
            "kind_one_row": lambda f: f[:1],
            "kind_one_column": lambda f: f[:, :1],
            "kind_strided": lambda f: np.repeat(f, 2, axis=1)[:, ::2],
            "kind_turned_in_memory": np.asfortranarray,
            "kind_read_only": lambda f: np.frombuffer(f.tobytes(), f.dtype).reshape(f.shape),
        },
    ),
    ("calibrations", "0 over 1 mm: masked, and correct elsewhere"): rows(
        on_calibration,
        {
            "factor_zero": partial(hole, "factors"),
            "light_zero": partial(hole, "radiance"),
        },
        needs=(Flag.OUTSIDE,),
    ),
    ("calibrations", "refused"): rows(
        on_calibration,
        {
            "light_zero_everywhere": partial(times, "radiance", 0.0),
            "leds_above_membrane": leds_above,
        },
    ),
    ("calibrations", "refused when the file is read"): rows(
        read,
        {
            "curve_falling": partial(with_curve, 1.0, -1),
            "curve_of_nan": partial(with_curve, np.nan, 1),
            "light_nan": partial(times, "radiance", np.nan),
            "light_negative": partial(times, "radiance", -1.0),
            "leds_nan": partial(times, "led_positions_mm", np.nan),
            "plane_behind_camera": plane_behind,
            "crosstalk_singular": lambda c: c.changed(crosstalk=np.ones((3, 3))),
        },
    ),
    ("calibrations", "finite and named"): {"light_beyond_curve": beyond_curve},
    ("numbers", "five runs, or 1, 2, 3 and 8 threads: the same bits"): {
        f"{name}_{model}": partial(repeated, model, threads)
        for model in MODELS
        for name, threads in (("runs", (2, 2, 2, 2, 2)), ("threads", (1, 2, 3, 8)))
    },
}


def input_cases() -> tuple[Case, ...]:
    """Return the cases, in the order of the table."""
    return cases_of(TABLE)


if __name__ == "__main__":
    for extreme in input_cases():
        print(run_case(extreme).line, flush=True)
