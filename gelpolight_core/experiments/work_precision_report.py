"""Error against run time as text, HTML, CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from gelpolight_core.experiments.integrators import IntegratorPoint
from gelpolight_core.experiments.report_page import Page, write_page
from gelpolight_core.experiments.work_precision import Point, observed_order, pareto_front
from gelpolight_core.experiments.work_precision_figures import (
    PAPER_HEIGHT_PERCENT,
    PAPER_MS,
    PAPER_SIZE_PERCENT,
    draw_depth_error,
    draw_integrators,
    draw_other_errors,
)
from gelpolight_core.export.atomic import write_atomically
from gelpolight_core.quality import QualityTable
from gelpolight_core.report.document import Listing, Section
from gelpolight_core.translation import tr

NUMBERS = ("median_ms", "p95_ms", "rms_um", "normal_deg", "height_percent", "size_percent")


def point_rows(points: Sequence[Point]) -> list[dict[str, Any]]:
    """Return one row for each method and size; None in a gap."""
    front = pareto_front(points)
    rows = []
    for point in points:
        row = {**asdict(point), "on_front": point in front}
        for key in NUMBERS:
            value = row[key]
            row[key] = value if value is not None and math.isfinite(value) else None
        rows.append(row)
    return rows


def order_rows(points: Sequence[Point]) -> list[dict[str, Any]]:
    """Return the observed order of each method of the virtual sensor."""
    virtual = [p for p in points if p.sensor.startswith("virtual-sensor-")]
    methods = dict.fromkeys((p.method, p.label) for p in virtual)
    return [
        {
            "method": name,
            "label": label,
            "order": observed_order([p for p in virtual if p.method == name]),
        }
        for name, label in methods
    ]


def point_table(points: Sequence[Point]) -> str:
    """Return the points as lines of text; a star marks the front."""
    front = pareto_front(points)
    head = (
        f"  {tr('method'):<46}{'Mpx':>6}{'ms':>9}{'p95':>9}{'RMS um':>9}{'deg':>7}"
        f"{tr('height %'):>10}{tr('size %'):>8}"
    )
    lines = [head]
    for p in points:
        cells = [getattr(p, key) for key in NUMBERS]
        mark = "*" if p in front else " "
        start = f"{mark} {p.label:<46}{p.megapixels:6.2f}"
        if any(cell is None for cell in cells):
            lines.append(f"{start}  {p.gap}")
            continue
        ms, p95, rms, angle, height, size = cells
        lines.append(f"{start}{ms:9.1f}{p95:9.1f}{rms:9.1f}{angle:7.2f}{height:10.2f}{size:8.2f}")
    return "\n".join(lines)


def order_table(points: Sequence[Point], integrators: Sequence[IntegratorPoint]) -> str:
    """Return the observed orders of convergence as lines of text."""
    lines = [tr("observed order of the depth's error in the pitch")]
    for row in order_rows(points):
        order = row["order"]
        lines.append(f"  {row['label']:<52}{'' if order is None else f'{order:6.2f}'}")
    for name, label in dict.fromkeys((p.name, p.label) for p in integrators):
        orders = [p.order for p in integrators if p.name == name and p.order is not None]
        lines.append(f"  {label:<52}{' '.join(f'{order:6.2f}' for order in orders)}")
    return "\n".join(lines)


def write_work_precision(
    points: Sequence[Point], integrators: Sequence[IntegratorPoint], folder: Path
) -> list[Path]:
    """Write ``work-precision.html``, ``.csv``, ``.json`` and ``integrators.csv``.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    rows, others = point_rows(points), [asdict(p) for p in integrators]
    content = {
        "paper": {
            "ms": PAPER_MS,
            "height_percent": PAPER_HEIGHT_PERCENT,
            "size_percent": PAPER_SIZE_PERCENT,
        },
        "points": rows,
        "front": [[p.sensor, p.method] for p in pareto_front(points)],
        "orders": order_rows(points),
        "integrators": others,
    }
    texts = {
        "work-precision.csv": _csv_text(rows),
        "work-precision.json": json.dumps(content, indent=1, allow_nan=False) + "\n",
        "integrators.csv": _csv_text(others),
    }
    for name, text in texts.items():
        write_atomically(folder / name, lambda out, text=text: out.write(text.encode()))  # type: ignore[misc]
    page = folder / "work-precision.html"
    write_page(work_precision_page(points, integrators), page)
    return [page, *(folder / name for name in texts)]


def work_precision_page(points: Sequence[Point], integrators: Sequence[IntegratorPoint]) -> Page:
    """Return the report as a page."""
    none = QualityTable()
    sections = [
        Section(
            f"sensor-{number}",
            _title(group),
            "",
            none,
            (),
            (draw_depth_error(mine), draw_other_errors(mine)),
            (_listing(mine),),
        )
        for number, (group, mine) in enumerate(_groups(points).items())
    ]
    if integrators:
        drawing, listing = draw_integrators(integrators), _integrator_listing(integrators)
        sections.append(
            Section("integrators", tr("Integration alone"), "", none, (), (drawing,), (listing,))
        )
    intro = tr(
        "What each method costs and how true it is. Times are medians of whole frames, taken in "
        "turn; errors are against a truth that no method knows. The paper states {ms:.0f} ms, "
        "{size:.0f} % in size and {height:.0f} % in height"
    ).format(ms=PAPER_MS, size=PAPER_SIZE_PERCENT, height=PAPER_HEIGHT_PERCENT)
    return Page(tr("Error against run time"), intro, tuple(sections))


def _groups(points: Sequence[Point]) -> dict[str, list[Point]]:
    """Return the points by what may be drawn in one diagram: all sizes of the virtual sensor."""
    groups: dict[str, list[Point]] = {}
    for point in points:
        virtual = point.sensor.startswith("virtual-sensor-")
        groups.setdefault("virtual-sensor" if virtual else point.sensor, []).append(point)
    return groups


def _title(group: str) -> str:
    return tr("The virtual sensor") if group == "virtual-sensor" else group


def _listing(points: Sequence[Point]) -> Listing:
    front = pareto_front(points)
    orders = {row["method"]: row["order"] for row in order_rows(points)}
    rows = []
    for p in points:
        order = orders.get(p.method)
        numbers = ["" if v is None else f"{v:.3g}" for v in (getattr(p, k) for k in NUMBERS)]
        rows.append(
            (
                p.label if not p.gap else f"{p.label}: {p.gap}",
                f"{p.megapixels:.2f}",
                *numbers,
                "" if order is None else f"{order:.2f}",
                tr("yes") if p in front else "",
            )
        )
    heads = (
        tr("Method"),
        "Mpx",
        "ms",
        "p95 ms",
        "RMS um",
        "deg",
        tr("Height %"),
        tr("Size %"),
        tr("Order"),
        tr("Front"),
    )
    return Listing("", heads, tuple(rows), (3.5, *(1.0,) * 9))


def _integrator_listing(points: Sequence[IntegratorPoint]) -> Listing:
    rows = tuple(
        (
            p.label,
            str(p.side),
            f"{p.median_ms:.2f}",
            f"{p.p95_ms:.2f}",
            f"{p.rms_um:.2g}",
            "" if p.order is None else f"{p.order:.2f}",
        )
        for p in points
    )
    heads = (tr("Integrator"), tr("Nodes a side"), "ms", "p95 ms", "RMS um", tr("Order"))
    return Listing("", heads, rows, (3.0, 1.0, 1.0, 1.0, 1.0, 1.0))


def _csv_text(rows: Sequence[dict[str, Any]]) -> str:
    stream = io.StringIO()
    if rows:
        writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return stream.getvalue()
