"""The result of a measurement, compared with true values."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.compared_quantity import TOLERANCE_PERCENT, Quantity
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding, join_reasons
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.session.reference_object import ReferenceObject

from .measured_value import MeasuredValue
from .statistics import finite_or_none


@dataclass(frozen=True, slots=True)
class Measurement:
    """Size, place and standard deviations of one measured object.

    Attributes
    ----------
    shape : str
        ``cylinder``, ``cuboid`` or ``ball``.
    diameter_mm : float or None
        Diameter of the cylinder or the ball; None for a cuboid.
    side_mm : (float, float) or None
        Sides of the cuboid, the first along `yaw_deg`; None for the round shapes.
    height_mm : float
        Indentation depth above the ground around the object.
    centre_mm : (float, float)
        (x, y) in the sensor frame.
    yaw_deg : float or None
        Angle from the x axis (towards y) to the cuboid's first side, -45 to 45.
    drape_decay_mm : float
        Decay length of the membrane around the object.
    sd : dict
        Standard deviations with the same names and form: the larger of the fit's residual and the
        noise, combined with calibration and mode.
    edge_radius_mm, blur_mm : float or None
        Fillet of the object and blur of the map as fitted; None for a ball.
    baseline_mm : float
        Level of the ground under the object, already subtracted from `height_mm`.
    residual_rms_mm : float
        Map minus fit around the object.
    outline_mm : (N, 2)
        Contact region, (x, y), closed, for an overlay.
    findings : tuple of Finding
        Why it is doubtful; empty when it is not.
    noise_sd : dict or None
        The part by noise, the scatter of repeated images; None if the map's noise is not known.
    calibration_sd : dict or None
        The part by the calibration, common to all its measurements; None if it is not known.
    mode_sd : dict or None
        The part by model and effort, which remains with any calibration; None if it is not known.

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> sensor = gp.Reconstructor(gp.read_calibration("sensor.gplcal"))
    >>> image = gp.read_image("session/presses/cylinder_s5_d100.png")
    >>> found = gp.measure(sensor.depth(image, uncertainty=True), shape="cylinder")
    >>> abs(found.diameter_mm - 5.0) < 3 * found.sd["diameter_mm"] + 0.1
    True
    """

    shape: str
    diameter_mm: float | None
    side_mm: tuple[float, float] | None
    height_mm: float
    centre_mm: tuple[float, float]
    yaw_deg: float | None
    drape_decay_mm: float
    sd: dict[str, Any]
    edge_radius_mm: float | None
    blur_mm: float | None
    baseline_mm: float
    residual_rms_mm: float
    outline_mm: Float64Array
    findings: tuple[Finding, ...] = ()
    noise_sd: dict[str, Any] | None = None
    calibration_sd: dict[str, Any] | None = None
    mode_sd: dict[str, Any] | None = None

    @property
    def verdict(self) -> str:
        """``ok``, or ``doubtful`` where there are findings."""
        return "doubtful" if self.findings else "ok"

    @property
    def reason(self) -> str:
        """Why it is doubtful, empty when ok."""
        return join_reasons(self.findings)

    @property
    def size_mm(self) -> float:
        """The diameter, or the mean side of a cuboid."""
        if self.side_mm is not None:
            return (self.side_mm[0] + self.side_mm[1]) / 2.0
        assert self.diameter_mm is not None
        return self.diameter_mm

    @property
    def size_sd_mm(self) -> float:
        """Standard deviation of `size_mm`."""
        if self.side_mm is not None:
            # Baseline and edge move both sides by the same amount, so errors do not average out.
            return float(np.mean(self.sd["side_mm"]))
        return float(self.sd["diameter_mm"])

    @property
    def height_sd_mm(self) -> float:
        """Standard deviation of `height_mm`."""
        return float(self.sd.get("height_mm", math.nan))

    @property
    def figures(self) -> tuple[MeasuredValue, ...]:
        """Its sizes, height, place and surroundings."""
        if self.side_mm is not None:
            named = zip(self.side_mm, self.sd["side_mm"], ("side_a", "side_b"), strict=True)
            sizes = tuple(MeasuredValue(side, sd, "mm", name) for side, sd, name in named)
        else:
            assert self.diameter_mm is not None
            sizes = (MeasuredValue(self.diameter_mm, self.sd["diameter_mm"], "mm", "diameter"),)
        turned: tuple[MeasuredValue, ...] = ()
        if self.yaw_deg is not None:
            turned = (MeasuredValue(self.yaw_deg, self.sd["yaw_deg"], "deg", "yaw"),)
        return (
            *sizes,
            MeasuredValue(self.height_mm, self.sd["height_mm"], "mm", "height"),
            MeasuredValue(self.centre_mm[0], self.sd["centre_mm"][0], "mm", "centre_x"),
            MeasuredValue(self.centre_mm[1], self.sd["centre_mm"][1], "mm", "centre_y"),
            *turned,
            MeasuredValue(self.drape_decay_mm, self.sd["drape_decay_mm"], "mm", "drape_decay"),
        )

    def with_findings(self, faults: tuple[Finding, ...]) -> Measurement:
        """Return the measurement with further findings."""
        return replace(self, findings=(*faults, *self.findings))

    def parts_of(self, key: str) -> tuple[tuple[str, float], ...]:
        """Return the known sources of a standard deviation, and their parts of it.

        Parameters
        ----------
        key : str
            As in `sd`; the sides of a cuboid count as their mean, for they err together.
        """
        parts = (
            ("noise", self.noise_sd),
            ("calibration", self.calibration_sd),
            ("model", self.mode_sd),
        )
        return tuple((name, float(np.mean(sd[key]))) for name, sd in parts if sd is not None)

    def as_json(
        self,
        truth: ReferenceObject | None = None,
        limits_percent: tuple[float, float] = TOLERANCE_PERCENT,
    ) -> dict[str, Any]:
        """Return the measurement as plain values, compared with the true sizes that are known.

        Parameters
        ----------
        truth : ReferenceObject, optional
            The reference.
        limits_percent : (float, float), optional
            Tolerances of size and height.
        """
        whole = truth if truth is not None and truth.is_whole else None
        compared = [
            q for q in compare_with_truth(self, truth, limits_percent) if q.truth is not None
        ]
        errors = whole and {q.name: q.error_percent for q in compared}
        side_mm, diameter = self.side_mm, {"diameter_mm": self.diameter_mm}
        return {
            "shape": self.shape,
            **(diameter if side_mm is None else {"side_mm": list(side_mm)}),
            "height_mm": self.height_mm,
            "centre_mm": list(self.centre_mm),
            "yaw_deg": self.yaw_deg,
            "drape_decay_mm": self.drape_decay_mm,
            "sd": _plain(self.sd),
            "noise_sd": _plain(self.noise_sd),
            "calibration_sd": _plain(self.calibration_sd),
            "mode_sd": _plain(self.mode_sd),
            "truth": whole and whole.as_json(),
            "error_percent": errors,
            "comparisons": [quantity.as_json() for quantity in compared],
            "reference_findings": [finding.text for finding in truth.findings()] if truth else [],
            "verdict": self.verdict,
            "reason": self.reason,
            "edge_radius_mm": self.edge_radius_mm,
            "baseline_mm": self.baseline_mm,
            "residual_rms_mm": self.residual_rms_mm,
        }


@dataclass(frozen=True, slots=True)
class MeasuredPress:
    """A measured object with what it was measured on, for its certificate.

    Attributes
    ----------
    name : str
        Name of the image.
    sha256 : str
        Hash of the image's file; empty for an image of the camera.
    height_map : HeightMap
        Reconstructed from it.
    measurement : Measurement
        Judged with the height map.
    truth : ReferenceObject or None
        The reference, if one is known.
    time : datetime
        When it was measured.
    """

    name: str
    sha256: str
    height_map: HeightMap
    measurement: Measurement
    truth: ReferenceObject | None = None
    time: datetime = field(default_factory=lambda: datetime.now(UTC))


def _plain(spread: dict[str, Any] | None) -> dict[str, Any] | None:
    return spread and {k: list(v) if isinstance(v, tuple) else v for k, v in spread.items()}


def compare_with_truth(
    measurement: Measurement,
    truth: ReferenceObject | None = None,
    limits_percent: tuple[float | None, float | None] = (None, None),
) -> tuple[Quantity, Quantity]:
    """Return size (of a cuboid: its mean side) and height of a measurement with their true values.

    Parameters
    ----------
    measurement : Measurement
        From :func:`~gelpolight_core.measurement.object_measurement.measure_object`.
    truth : ReferenceObject, optional
        Its sizes that are stated.
    limits_percent : (float, float), optional
        Tolerances of size and height.

    Raises
    ------
    InputError
        If the shape differs from that of the truth, or a true size is not positive.
    """
    truth = truth or ReferenceObject(measurement.shape)
    if truth.shape != measurement.shape:
        text = f"the true shape is a {truth.shape}, but a {measurement.shape} was measured"
        raise InputError(text, "truth", Remedy.CHOOSE_SHAPE)
    for value in (truth.size_mm, truth.second_mm, truth.height_mm):
        if value < 0.0 or not math.isfinite(value):
            text = f"the true size is {value} mm, not greater than zero"
            raise InputError(text, "truth", Remedy.CORRECT_VALUE)
    rows = (
        (truth.size_key, measurement.size_mm, measurement.size_sd_mm, truth.mean_size_mm),
        ("height_mm", measurement.height_mm, measurement.height_sd_mm, truth.height_mm),
    )
    references = truth.size_sd_mm, truth.height_sd_mm
    size, height = (
        Quantity(
            name,
            value,
            finite_or_none(sd),
            true or None,
            limit,
            reference,
            measurement.parts_of(name),
        )
        for (name, value, sd, true), reference, limit in zip(
            rows, references, limits_percent, strict=True
        )
    )
    return size, height
