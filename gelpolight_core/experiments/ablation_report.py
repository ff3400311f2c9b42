"""The ablation as text, Markdown, CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gelpolight_core.calibration.terms import ALL_CALIBRATION_TERMS
from gelpolight_core.experiments.ablation import Ablation, TermResult
from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.translation import tr, translated

COLUMNS = (
    "sensor",
    "left_out",
    "instead",
    "height_percent",
    "size_percent",
    "rms_um",
    "worst_rms_um",
    "worth_rms_um",
    "frame_ms",
    "cost_ms",
    "cost_calibration_s",
    "presses",
)


def ablation_rows(ablation: Ablation) -> list[dict[str, Any]]:
    """Return one table row for each variant, by the names of :data:`COLUMNS`.

    Benefit and cost of a term are differences to all terms on; None if they do not apply.
    """
    everything = ablation.results[0]
    return [
        {
            "sensor": ablation.sensor,
            "left_out": result.variant.name,
            "instead": translated(result.variant.label),
            "height_percent": result.score.height_percent,
            "size_percent": result.score.size_percent,
            "rms_um": result.score.rms_um,
            "worst_rms_um": result.score.worst_rms_um,
            "worth_rms_um": result.score.rms_um - everything.score.rms_um,
            "frame_ms": result.frame_ms,
            "cost_ms": result.cost_ms,
            "cost_calibration_s": _calibration_cost(result, everything),
            "presses": result.score.count,
        }
        for result in ablation.results
    ]


def ablation_table(ablation: Ablation) -> str:
    """Return the ablation of one sensor as lines of text."""
    first = ablation.results[0]
    title = tr(
        "{sensor}: {n} presses; processor time with all terms: {ms:.0f} ms a frame, {s:.1f} s of "
        "joint refinement"
    ).format(sensor=ablation.sensor, n=first.score.count, ms=first.frame_ms, s=first.calibration_s)
    head = (
        f"{tr('without the term'):<34}{tr('height %'):>9}{tr('size %'):>8}{tr('RMS um'):>8}"
        f"{tr('worst'):>8}{tr('worth um'):>10}{tr('cost ms'):>9}{tr('cost s'):>8}"
    )
    rows = (_text_line(row) for row in ablation_rows(ablation))
    return "\n".join([title, head, *rows, *_refused_lines(ablation)])


def _refused_lines(ablation: Ablation) -> list[str]:
    """Return a line for each variant that is refused."""
    return [
        tr("Refused: {variant}. {why}").format(variant=translated(variant.label), why=why)
        for variant, why in ablation.refused
    ]


def ablation_markdown(ablations: Sequence[Ablation]) -> str:
    """Return the ablations as Markdown, a table for each sensor."""
    parts = []
    for ablation in ablations:
        first = ablation.results[0]
        summary = tr(
            "{n} presses; with all terms, a frame takes {ms:.0f} ms of processor "
            "time, the joint refinement {s:.1f} s."
        )
        parts += [
            f"### {ablation.sensor}",
            summary.format(n=first.score.count, ms=first.frame_ms, s=first.calibration_s),
            "\n".join(
                [
                    "| left out | what is done instead | height % | size % | RMS um | worst RMS um "
                    "| worth, RMS um | cost, ms a frame | cost, s of calibration |",
                    "|---|---|---|---|---|---|---|---|---|",
                    *(_markdown_line(row) for row in ablation_rows(ablation)),
                ]
            ),
            *_refused_lines(ablation),
        ]
    return "\n\n".join(parts) + "\n"


def write_ablation(ablations: Sequence[Ablation], folder: Path) -> list[Path]:
    """Write ``ablation.csv``, ``.json`` and ``.md`` into a folder; return what was written.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    rows = [row for ablation in ablations for row in ablation_rows(ablation)]
    stream = io.StringIO()
    writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    refused = [
        {"sensor": ablation.sensor, "left_out": variant.name, "why": why}
        for ablation in ablations
        for variant, why in ablation.refused
    ]
    content = {"repeats": ablations[0].repeats, "rows": rows, "refused": refused}
    texts = {
        "ablation.csv": stream.getvalue(),
        "ablation.json": json.dumps(content, indent=1, allow_nan=False) + "\n",
        "ablation.md": ablation_markdown(ablations),
    }
    for name, text in texts.items():
        write_atomically(folder / name, lambda out, text=text: out.write(text.encode()))  # type: ignore[misc]
    return [folder / name for name in texts]


def _calibration_cost(result: TermResult, everything: TermResult) -> float | None:
    recalibrated = result.variant.calibration != ALL_CALIBRATION_TERMS
    cost = everything.calibration_s - result.calibration_s
    return cost if recalibrated and math.isfinite(cost) else None


def _text_line(row: dict[str, Any]) -> str:
    seconds = row["cost_calibration_s"]
    return (
        f"{row['instead']:<34}{row['height_percent']:9.2f}{row['size_percent']:8.2f}"
        f"{row['rms_um']:8.1f}{row['worst_rms_um']:8.1f}{row['worth_rms_um']:+10.1f}"
        f"{row['cost_ms']:+9.1f}{'' if seconds is None else f'{seconds:+.1f}':>8}"
    ).rstrip()


def _markdown_line(row: dict[str, Any]) -> str:
    seconds = row["cost_calibration_s"]
    cells = (
        row["left_out"],
        row["instead"],
        f"{row['height_percent']:.2f}",
        f"{row['size_percent']:.2f}",
        f"{row['rms_um']:.1f}",
        f"{row['worst_rms_um']:.1f}",
        f"{row['worth_rms_um']:+.1f}",
        f"{row['cost_ms']:+.0f}",
        "" if seconds is None else f"{seconds:+.1f}",
    )
    return f"| {' | '.join(cells)} |"
