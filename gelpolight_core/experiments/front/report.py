"""Error against run time as text, HTML, CSV, JSON and Markdown."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from gelpolight_core.experiments.front.figures import (
    PAPER_HEIGHT_PERCENT,
    PAPER_MS,
    PAPER_SIZE_PERCENT,
    draw_depth_error,
    draw_other_errors,
)
from gelpolight_core.experiments.front.measure import Point, fronts, observed_order
from gelpolight_core.experiments.front.quiet import Machine
from gelpolight_core.experiments.integrators.measure import IntegratorPoint
from gelpolight_core.experiments.integrators.report import integrator_section
from gelpolight_core.experiments.leave_out import RuleFigure
from gelpolight_core.experiments.report_page import Page, write_page
from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.quality import QualityTable
from gelpolight_core.report.document import Listing, Section
from gelpolight_core.translation import tr

NUMBERS = ("median_ms", "p95_ms", "rms_um", "normal_deg", "height_percent", "size_percent")


def point_rows(points: Sequence[Point]) -> list[dict[str, Any]]:
    """Return one row for each sensor, size and method; None in a gap."""
    front = fronts(points)
    rows = []
    for point in points:
        row = {**asdict(point), "on_front": point in front}
        for key, value in row.items():
            if isinstance(value, float) and not math.isfinite(value):
                row[key] = None
        rows.append(row)
    return rows


def order_rows(points: Sequence[Point]) -> list[dict[str, Any]]:
    """Return the observed order of each method on each sensor, with its uncertainty."""
    rows = []
    for sensor, method, label in dict.fromkeys((p.sensor, p.method, p.label) for p in points):
        order = observed_order([p for p in points if (p.sensor, p.method) == (sensor, method)])
        if order is not None:
            rows.append(
                {
                    "sensor": sensor,
                    "method": method,
                    "label": label,
                    "order": order.value,
                    "half_width": order.half_width,
                    "sizes": order.sizes,
                    "text": order.text,
                    "limit": order.limit,
                }
            )
    return rows


def point_table(points: Sequence[Point]) -> str:
    """Return the points as lines of text; a star marks the front."""
    front = fronts(points)
    head = (
        f"  {tr('sensor'):<14}{tr('method'):<46}{tr('width'):>6}{'ms':>9}{'p95':>9}{'RMS um':>9}"
        f"{'deg':>7}{tr('height %'):>10}{tr('size %'):>8}"
    )
    lines = [head]
    for p in points:
        cells = [getattr(p, key) for key in NUMBERS]
        mark = "*" if p in front else " "
        start = f"{mark} {p.sensor:<14}{p.label:<46}{p.width:6d}"
        if any(cell is None for cell in cells):
            lines.append(f"{start}  {p.gap}")
            continue
        ms, p95, rms, angle, height, size = cells
        lines.append(f"{start}{ms:9.1f}{p95:9.1f}{rms:9.1f}{angle:7.2f}{height:10.2f}{size:8.2f}")
    return "\n".join(lines)


def order_table(points: Sequence[Point]) -> str:
    """Return the observed orders of the depth error as lines of text."""
    lines = [tr("observed order of the depth error in the pitch, 95 % interval")]
    for row in order_rows(points):
        limit = tr("limited by: {what}").format(what=row["limit"]) if row["limit"] else ""
        lines.append(f"  {row['sensor']:<14}{row['label']:<46}{row['text']:>14}  {limit}".rstrip())
    return "\n".join(lines)


def write_work_precision(
    points: Sequence[Point],
    integrators: Sequence[IntegratorPoint],
    folder: Path,
    *,
    rules: Sequence[RuleFigure] = (),
    machine: Machine | None = None,
) -> list[Path]:
    """Write ``work-precision`` as HTML, CSV and JSON, ``integrators.csv``, ``rules.csv``, images.

    Parameters
    ----------
    points, integrators : sequence
        What was measured.
    folder : Path
        Where the files are written.
    rules : sequence of RuleFigure, optional
        Rules that skip work, and the time they save.
    machine : Machine, optional
        The machine, and the other programs that ran.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    rows, others = point_rows(points), [asdict(p) for p in integrators]
    figures = [{**asdict(f), "saved_percent": f.saved_percent} for f in rules]
    content = {
        "paper": {
            "ms": PAPER_MS,
            "height_percent": PAPER_HEIGHT_PERCENT,
            "size_percent": PAPER_SIZE_PERCENT,
        },
        "machine": None if machine is None else machine.as_dict(),
        "points": rows,
        "front": [[p.sensor, p.width, p.method] for p in fronts(points)],
        "orders": order_rows(points),
        "integrators": others,
        "rules": figures,
    }
    texts = {
        "work-precision.csv": _csv_text(rows),
        "work-precision.json": json.dumps(content, indent=1, allow_nan=False) + "\n",
        **({"integrators.csv": _csv_text(others)} if others else {}),
        **({"rules.csv": _csv_text(figures)} if figures else {}),
    }
    for name, text in texts.items():
        write_atomically(folder / name, lambda out, text=text: out.write(text.encode()))  # type: ignore[misc]
    images = []
    for sensor, mine in _by_sensor(points).items():
        image = folder / f"front-{sensor}.png"
        data = draw_depth_error(mine).png
        write_atomically(image, lambda out, data=data: out.write(data))  # type: ignore[misc]
        images.append(image)
    page = folder / "work-precision.html"
    write_page(work_precision_page(points, integrators, rules, machine), page)
    return [page, *(folder / name for name in texts), *images]


def work_precision_page(
    points: Sequence[Point],
    integrators: Sequence[IntegratorPoint],
    rules: Sequence[RuleFigure],
    machine: Machine | None,
) -> Page:
    """Return the report as a page: one section for each sensor."""
    none = QualityTable()
    sections = [
        Section(
            f"sensor-{number}",
            sensor,
            "",
            none,
            (),
            (draw_depth_error(mine), draw_other_errors(mine)),
            (_listing(mine),),
        )
        for number, (sensor, mine) in enumerate(_by_sensor(points).items())
    ]
    if integrators:
        sections.append(integrator_section(integrators))
    if rules:
        title = tr("Skipped steps and their effect")
        sections.append(Section("rules", title, "", none, (), (), (_rule_listing(rules),)))
    intro = tr(
        "Run time and error of each method. Times are for whole frames over all "
        "presses, with the methods in turn; errors are differences from the true "
        "depth, which no method uses. The paper states {ms:.0f} ms, {size:.0f} % "
        "in size and {height:.0f} % in height"
    ).format(ms=PAPER_MS, size=PAPER_SIZE_PERCENT, height=PAPER_HEIGHT_PERCENT)
    if machine is not None:
        intro += ". " + tr("Measured on {machine}").format(machine=machine.text)
    return Page(tr("Error against run time"), intro, tuple(sections))


def _by_sensor(points: Sequence[Point]) -> dict[str, list[Point]]:
    groups: dict[str, list[Point]] = {}
    for point in points:
        groups.setdefault(point.sensor, []).append(point)
    return groups


def _listing(points: Sequence[Point]) -> Listing:
    front = fronts(points)
    orders = {row["method"]: row["text"] for row in order_rows(points)}
    rows = []
    for p in points:
        numbers = ["" if v is None else f"{v:.3g}" for v in (getattr(p, k) for k in NUMBERS)]
        rows.append(
            (
                p.label if not p.gap else f"{p.label}: {p.gap}",
                str(p.width),
                *numbers,
                orders.get(p.method, ""),
                tr("yes") if p in front else "",
            )
        )
    heads = (
        tr("Method"),
        tr("Width"),
        "ms",
        "p95 ms",
        "RMS um",
        "deg",
        tr("Height %"),
        tr("Size %"),
        tr("Order"),
        tr("Front"),
    )
    return Listing("", heads, tuple(rows), (3.5, *(1.0,) * 7, 1.6, 1.0))


def _rule_listing(rules: Sequence[RuleFigure]) -> Listing:
    rows = tuple(
        (
            f.sensor,
            f.label,
            f.effort,
            f"{f.with_ms:.1f}",
            f"{f.without_ms:.1f}",
            f"{f.saved_percent:.0f}",
            f"{f.change_um:.2f}",
            f"{f.change_rms_um:.2f}",
        )
        for f in rules
    )
    heads = (
        tr("Sensor"),
        tr("Left out"),
        tr("Effort"),
        tr("With ms"),
        tr("Without ms"),
        tr("Saved %"),
        tr("Change um"),
        tr("RMS um"),
    )
    return Listing("", heads, rows, (1.5, 3.5, *(1.0,) * 6))


def _csv_text(rows: Sequence[dict[str, Any]]) -> str:
    stream = io.StringIO()
    if rows:
        writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return stream.getvalue()
