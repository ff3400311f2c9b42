"""Check that results repeat: precision, repeated runs, number of threads."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.experiments.plain_paper import plain_depth, plain_slopes
from gelpolight_core.experiments.stability import Case, Seen
from gelpolight_core.experiments.stability_grids import LARGE, bump
from gelpolight_core.experiments.stability_trial import (
    rms_um,
    standard_press,
    standard_sensor,
)
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.integration.poisson import PoissonSolver
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor_calibration import MODELS
from gelpolight_core.translation import tr

SUBJECT = "numbers"
THREADS = (1, 2, 3, 8)
RUNS = 5
SINGLE_UM = 0.05


def number_cases() -> tuple[Case, ...]:
    """Return the cases on precision and repeatability."""
    cases = []
    for model in MODELS:
        cases += [
            Case(
                f"runs_{model}",
                SUBJECT,
                tr("{n} runs of the {model} model").format(n=RUNS, model=model),
                tr("identical, bit by bit"),
                partial(_runs, model),
            ),
            Case(
                f"threads_{model}",
                SUBJECT,
                tr("the {model} model on {n} threads").format(
                    model=model, n=", ".join(map(str, THREADS))
                ),
                tr("identical, bit by bit"),
                partial(_threads, model),
            ),
        ]
    sizes = {"quarter": (240, 320), "whole": (960, 1280), "32_megapixels": LARGE}
    return (
        *cases,
        *(
            Case(
                f"single_precision_{name}",
                SUBJECT,
                tr("integration in single compared with double precision, {r} x {c}").format(
                    r=size[0], c=size[1]
                ),
                tr("less than {x:g} um apart").format(x=SINGLE_UM),
                partial(_precision, *size),
                quick=name == "quarter",
                memory=name == "32_megapixels",
            )
            for name, size in sizes.items()
        ),
        Case(
            "single_precision_frame",
            SUBJECT,
            tr("the paper's model, fused in single compared with plain in double precision"),
            tr("less than 1 um apart"),
            _paper_precision,
        ),
    )


def _same(maps: list[HeightMap]) -> bool:
    first = maps[0]
    return all(
        np.array_equal(first.depth_mm, m.depth_mm) and np.array_equal(first.flags, m.flags)
        for m in maps[1:]
    )


def _compared(same: bool, maps: list[HeightMap]) -> Seen:
    away = max(float(np.abs(m.depth_mm - maps[0].depth_mm).max()) for m in maps)
    if same:
        return Seen(True, tr("identical, bit by bit"))
    return Seen(False, tr("up to {d:.2g} um apart").format(d=1e3 * away))


def _runs(model: str) -> Seen:
    reconstruct = Reconstructor(standard_sensor().calibration, model=model)
    maps = [reconstruct.depth(standard_press().frame) for _ in range(RUNS)]
    return _compared(_same(maps), maps)


def _threads(model: str) -> Seen:
    calibration, frame = standard_sensor().calibration, standard_press().frame
    maps = [Reconstructor(calibration, model=model, workers=n).depth(frame) for n in THREADS]
    return _compared(_same(maps), maps)


def _precision(rows: int, columns: int) -> Seen:
    _, slope_x, slope_y, pitch = bump(rows, columns)

    def solved(kind: type[np.floating]) -> NDArray[np.floating]:
        return (
            PoissonSolver(rows, columns, pitch_mm=pitch, dtype=kind)
            .integrate(slope_x, slope_y)
            .depth_mm
        )

    away = 1e3 * float(np.abs(solved(np.float32) - solved(np.float64)).max())
    summary = tr("at most {d:.2g} um of 1 mm apart").format(d=away)
    return Seen(away < SINGLE_UM, summary, error_um=away, bound_um=SINGLE_UM)


def _paper_precision() -> Seen:
    known, frame = standard_sensor(), standard_press().frame
    calibration = known.calibration
    table = calibration.table
    fused = Reconstructor(calibration, model="paper").depth(frame).depth_mm
    slopes = plain_slopes(frame, calibration)
    plain = plain_depth(*slopes, table.grid.pitch_mm)
    apart = rms_um((fused - plain)[table.valid].astype(np.float64))
    summary = tr("{e:.2g} um RMS apart, stencils of order 4 and 2 included").format(e=apart)
    return Seen(apart < 1.0, summary, error_um=apart, bound_um=1.0)
