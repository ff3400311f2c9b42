"""``gelpolight measure``: the sizes of pressed objects."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gelpolight_core.base.atomic_write import write_json
from gelpolight_core.base.compared_quantity import Quantity, value_text
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.health.frame_health import as_dict
from gelpolight_core.lab.reference_press import read_truth
from gelpolight_core.measurement.map_reliability import with_map_findings
from gelpolight_core.measurement.measurable_depth import measurable_depth
from gelpolight_core.measurement.measured_value import named
from gelpolight_core.measurement.object_measurement import AUTO, SHAPES, measure_heightmap
from gelpolight_core.measurement.result import MeasuredPress, Measurement, compare_with_truth
from gelpolight_core.output.report.document import refuse_other_endings
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.file_hashes import file_hash
from gelpolight_core.session.reference_object import ReferenceObject
from gelpolight_core.session.session_images import read_colours

from .common import tolerance, tolerances
from .options import Command, file_option, option, positional, result_option
from .parser import MENDABLE
from .reconstructing import despite_faults, load_reconstructor, model
from .terminal import print_safe


@dataclass(frozen=True)
class MeasureCommand(Command):
    """The sizes of pressed objects."""

    calibration: Path = positional("CALIBRATION")
    images: list[Path] = positional("IMAGE")
    shape: str = option(choices=(*SHAPES, AUTO))
    at: tuple[float, float] | None = option(
        "a point in mm on the object to measure, where several are pressed", metavar=("X", "Y")
    )
    truth: Path | None = file_option("truth.csv with these images")
    edge_radius: float | None = option(
        help="edge radius of the cylinder or cuboid in mm, if it is known", metavar="MM"
    )
    tolerance: tuple[float, float] | None = tolerance()
    json: Path | None = result_option()
    report: Path | None = option(
        help="certificate to write, with uncertainty budget and decisions",
        metavar="FILE.pdf",
        writes=True,
    )
    despite_faults: bool = despite_faults()
    model: str | None = model()

    def run(self) -> int:
        """Measure each image and print the results.

        An image that cannot be measured is reported, and the other images are measured.
        """
        if self.report is not None:
            refuse_other_endings(self.report)
            from gelpolight_core.output.report.certificate import measurement_report
            from gelpolight_core.output.report.report_pdf_file import write_report  # slow to import

        truths, limits = self._truths(), tolerances(self.tolerance)
        reconstructor = load_reconstructor(self.calibration, self.model)
        has_several = len(self.images) > 1
        entries, refused = [], 0
        certified: list[MeasuredPress] = []
        for image in self.images:
            try:
                entry, lines = self._measured(
                    image, reconstructor, truths.get(image.name), limits, certified
                )
            except InputError as error:
                if not has_several:
                    raise
                refused += 1
                message = str(error) if str(image) in str(error) else f"{image}: {error}"
                print_safe(f"gelpolight: {message}", file=sys.stderr)
                entries.append({"image": image.name, "error": str(error)})
                continue
            entries.append({"image": image.name} | entry if has_several else entry)
            text = [f"{image}:", *(f"  {line}" for line in lines)] if has_several else lines
            print_safe("\n".join(text))
        if self.json:
            write_json(self.json, entries if has_several else entries[0])
        if self.report and certified:
            certificate = measurement_report(
                reconstructor.calibration, certified, limits_percent=limits
            )
            write_report(certificate, self.report)
        return MENDABLE if refused else 0

    def _measured(
        self,
        image: Path,
        reconstructor: Reconstructor,
        truth: ReferenceObject | None,
        limits_percent: tuple[float, float],
        certified: list[MeasuredPress],
    ) -> tuple[dict[str, Any], list[str]]:
        """Reconstruct an image, and fit the object. Return JSON values and text."""
        heightmap = measurable_depth(
            reconstructor,
            read_colours(image, response=reconstructor.calibration.response),
            where=str(image),
            despite_faults=self.despite_faults,
        )
        findings = () if heightmap.health is None else heightmap.health.findings
        faults = {"faults": [as_dict(finding) for finding in findings]}
        notes = [finding.line for finding in findings if not finding.doubtful]
        edge_mm, edge_sd_mm = self.edge_radius, None
        if truth is not None and edge_mm is None:
            edge_mm, edge_sd_mm = truth.edge_mm
        fit = measure_heightmap(
            heightmap,
            shape=self.shape,
            seed_mm=self.at,
            edge_radius_mm=edge_mm,
            edge_radius_sd_mm=edge_sd_mm,
        )
        measurement = with_map_findings(fit, heightmap)
        digest = file_hash(image)
        certified.append(MeasuredPress(image.name, digest, heightmap, measurement, truth))
        values = measurement.as_json(truth, limits_percent)
        notes += [] if truth is None else [finding.line for finding in truth.findings()]
        sizes = compare_with_truth(measurement, truth, limits_percent)
        shape = [f"{'shape':<12} {measurement.shape}"] if self.shape == AUTO else []
        return values | faults, [*shape, *measurement_lines(measurement, sizes), *notes]

    def _truths(self) -> dict[str, ReferenceObject]:
        """Return the true sizes of each image's object, if a file with them is given."""
        if self.truth is None:
            return {}
        rows = {row.file: row.truth for row in read_truth(self.truth).rows}
        for image in self.images:
            if image.name not in rows:
                raise InputError(f"There is no row for {image.name}", self.truth, Remedy.TRUTH_ROW)
        return rows


def measurement_lines(measurement: Measurement, sizes: Iterable[Quantity]) -> list[str]:
    """Return a measurement as lines of text: each value, its sources of error, its comparison."""
    lines = []
    for label, size in named(measurement.figures, sizes):
        line = f"{label:<12} {size.text}"
        if size.parts:
            line += f"  ({', '.join(f'{name} {value_text(sd)}' for name, sd in size.parts)})"
        if size.truth is not None:
            line += f"  error {size.error_percent:+.2f} %, {size.judgement}"
        lines.append(line)
    verdict = ": ".join(filter(None, (measurement.verdict, measurement.reason)))
    return [*lines, f"{'verdict':<12} {verdict}"]
