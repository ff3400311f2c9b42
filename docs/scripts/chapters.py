"""The tables and diagrams of the chapters on speed and error, from the figures of a run."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from gelpolight_core.design_check.lighting import LightingRow, lighting_name
from gelpolight_core.experiments.front.figures import paint_depth_error
from gelpolight_core.experiments.front.measure import Point, fronts, observed_order
from gelpolight_core.experiments.front.quiet import Machine
from gelpolight_core.experiments.integrators.measure import IntegratorPoint, integrator_order
from gelpolight_core.experiments.integrators.report import paint_integrators
from gelpolight_core.experiments.leave_out import RuleFigure, worthless
from gelpolight_core.io.atomic import make_folder
from gelpolight_core.report.drawing import draw

DOCS = Path(__file__).resolve().parents[1]
CHAPTERS = ("error-against-time.md", "speed.md")
MARK = re.compile(r"(<!-- made: ([\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)
OURS = ("paper", "full_fast", "full_balanced", "full_best")
SIZES_SENSOR = "virtual-matt"


@dataclass(frozen=True)
class Figures:
    """All that was measured."""

    points: tuple[Point, ...]
    integrators: tuple[IntegratorPoint, ...]
    rules: tuple[RuleFigure, ...]
    lighting: tuple[LightingRow, ...]
    steps: dict[str, list[dict[str, Any]]]
    machine: Machine


def machine_text(figures: Figures) -> str:
    """Return where it was measured."""
    text = f"Measured on a machine with {figures.machine.text}."
    if figures.machine.busiest:
        text += f" When it began, these also ran: {', '.join(figures.machine.busiest)}."
    return text


def front_text(figures: Figures) -> str:
    """Return whether our modes form the front, and where not."""
    points = figures.points
    front = fronts(points)
    groups = list(dict.fromkeys((p.sensor, p.width) for p in points))
    others = [p for p in front if p.method not in (*OURS, "paper_plain")]
    alone = len(groups) - len({(p.sensor, p.width) for p in others})
    lines = [
        f"- Our modes form the front alone in {alone} of {len(groups)} combinations of sensor and "
        "image size."
    ]
    for p in others:
        lines.append(
            f"- On {p.sensor} at {p.width} pixels the {p.label} is on the front: "
            f"{p.median_ms:.0f} ms, {p.rms_um:.0f} um. It is faster than the more accurate modes, "
            "not more accurate than ours."
            if p.rms_um > min(q.rms_um for q in front if (q.sensor, q.width) == (p.sensor, p.width))
            else f"- On {p.sensor} at {p.width} pixels the {p.label} is the most accurate."
        )
    for sensor in dict.fromkeys(p.sensor for p in points):
        mine = [p for p in points if p.sensor == sensor and p.rms_um is not None]
        width = native(mine)
        here = [p for p in mine if p.width == width]
        best = min((p for p in here if p.method in OURS), key=lambda p: p.rms_um)
        rival = min((p for p in here if p.family == "rival"), key=lambda p: p.rms_um, default=None)
        if rival is not None:
            lines.append(
                f"- {sensor}, {width} pixels: best of ours {best.rms_um:.1f} um ({best.label}), "
                f"best rival {rival.rms_um:.1f} um ({rival.label})."
            )
    return "\n".join(lines)


def front_tables(figures: Figures) -> str:
    """Return a diagram and a table for each sensor."""
    parts = []
    front = fronts(figures.points)
    for sensor in dict.fromkeys(p.sensor for p in figures.points):
        mine = [p for p in figures.points if p.sensor == sensor]
        width = native(mine)
        orders = {}
        for name in dict.fromkeys(p.method for p in mine):
            orders[name] = observed_order([p for p in mine if p.method == name])
        rows = []
        for p in mine:
            if p.width != width:
                continue
            if p.rms_um is None:
                continue
            order = orders[p.method]
            rows.append(
                (
                    f"**{p.label}**" if p in front else p.label,
                    f"{p.median_ms:.1f}",
                    f"{p.p95_ms:.1f}",
                    f"{p.rms_um:.1f} ({p.rms_low_um:.1f} - {p.rms_high_um:.1f})",
                    f"{p.normal_deg:.1f}",
                    f"{p.height_percent:.1f}",
                    f"{p.size_percent:.1f}",
                    "" if order is None else order.text,
                    "" if order is None else order.limit,
                )
            )
        heads = (
            "method", "ms", "p95 ms", "depth um (quartiles)", "normals deg", "height %", "size %",
            "order", "limited by",
        )  # fmt: skip
        presses = max(p.presses for p in mine)
        parts.append(
            f"### {sensor}\n\n![Error against time on {sensor}](diagrams/front-{sensor}.webp)\n\n"
            f"{width} pixels wide, {presses} presses; bold: on the front.\n\n{table(heads, rows)}"
        )
    return "\n\n".join(parts)


def integrator_tables(figures: Figures) -> str:
    """Return the error of each integrator on each surface."""
    points = figures.integrators
    side = min({p.side for p in points if p.scene != "bump"}, default=max(p.side for p in points))
    here = [p for p in points if p.side == side]
    scenes = list(dict.fromkeys((p.scene, p.scene_label) for p in here))
    rows = []
    for name in dict.fromkeys(p.name for p in here):
        mine = {p.scene: p for p in here if p.name == name}
        order = integrator_order(points, name)
        rows.append(
            (
                next(iter(mine.values())).label,
                *(f"{short(mine[s].mean_um)} / {short(mine[s].middle_um)}" for s, _ in scenes),
                f"{np.median([p.median_ms for p in mine.values()]):.1f}",
                "" if order is None else order.text,
            )
        )
    heads = ("integrator", *(label for _, label in scenes), "ms", "order")
    return (
        "![Integration alone](diagrams/integrators.webp)\n\n"
        f"{side} x {side} nodes; mean / median error in um.\n\n{table(heads, rows)}"
    )


def rule_tables(figures: Figures) -> str:
    """Return what each rule saves and changes."""
    rows = [
        (
            f.label,
            f.sensor,
            f.effort,
            f"{f.with_ms:.1f}",
            f"{f.without_ms:.1f}",
            f"{f.saved_percent:.0f}",
            short(f.change_um),
            short(f.change_rms_um),
        )
        for f in sorted(figures.rules, key=lambda f: (f.rule, f.sensor))
    ]
    heads = (
        "left out", "sensor", "effort", "ms", "ms without the rule", "saved %", "largest change um",
        "RMS um",
    )  # fmt: skip
    idle = worthless(figures.rules)
    text = "Every rule saves more than 3 % at some effort."
    if idle:
        text = f"These save less than 3 % everywhere: {', '.join(idle)}."
    return f"{text}\n\n{table(heads, rows)}"


def mode_table(figures: Figures) -> str:
    """Return time and errors of our modes on every sensor."""
    rows = []
    for sensor in dict.fromkeys(p.sensor for p in figures.points):
        mine = [p for p in figures.points if p.sensor == sensor]
        width = native(mine)
        for p in mine:
            if p.width == width and p.method in OURS and p.rms_um is not None:
                rows.append(
                    (
                        p.label,
                        sensor,
                        f"{p.median_ms:.0f}",
                        f"{p.p95_ms:.0f}",
                        f"{p.height_percent:.1f}",
                        f"{p.size_percent:.1f}",
                        f"{p.rms_um:.1f}",
                    )
                )
    heads = ("mode", "sensor", "ms", "p95 ms", "height %", "size %", "depth um")
    return table(heads, rows)


def size_table(figures: Figures) -> str:
    """Return the time of our modes by image size."""
    mine = [p for p in figures.points if p.sensor == SIZES_SENSOR and p.method in OURS]
    rows = []
    for width in dict.fromkeys(p.width for p in mine):
        here = {p.method: p for p in mine if p.width == width and p.median_ms is not None}
        first = next(iter(here.values()))
        cells = [
            f"{here[m].median_ms:.0f} ms ({here[m].median_ms / here[m].megapixels:.0f} ms/MP)"
            if m in here
            else ""
            for m in OURS
        ]
        rows.append((f"{width} ({first.megapixels:.1f} MP)", *cells))
    return table(("width", "paper", "fast", "balanced", "best"), rows)


def step_table(figures: Figures) -> str:
    """Return the time of each step by mode."""
    modes = list(figures.steps)
    names = list(dict.fromkeys(r["name"] for rows in figures.steps.values() for r in rows))
    last = ("image to depth", "memory copy")
    names = [n for n in names if n not in last] + list(last)
    rows = []
    for name in names:
        cells = []
        for mode in modes:
            found = [r for r in figures.steps[mode] if r["name"] == name]
            cells.append(f"{found[0]['median_ms']:.1f}" if found else "")
        label = "image to depth" if name == "image to depth" else name
        rows.append((f"**{label}**" if name == last[0] else label, *cells))
    return table(("step, ms", *modes), rows)


def lighting_table(figures: Figures) -> str:
    """Return shadow and error by kind of light and method."""
    rows = [
        (
            lighting_name(r),
            f"{r.shadow_percent:.1f}",
            f"{r.unsolved_percent:.1f}",
            um(r.near_um),
            um(r.parallel_um),
            um(r.near_height_percent),
            um(r.parallel_height_percent),
        )
        for r in figures.lighting
    ]
    heads = (
        "light", "in shadow %", "unsolved %", "near-light method um", "directional method um",
        "height, near-light %", "height, directional %",
    )  # fmt: skip
    return table(heads, rows)


PARTS: dict[str, Callable[[Figures], str]] = {
    "machine": machine_text,
    "front": front_text,
    "sensors": front_tables,
    "integrators": integrator_tables,
    "lighting": lighting_table,
    "rules": rule_tables,
    "modes": mode_table,
    "sizes": size_table,
    "steps": step_table,
}


def write(figures: Figures) -> None:
    """Write tables and diagrams into the chapters."""
    for name in CHAPTERS:
        path = DOCS / name
        text = path.read_text("utf-8")
        made = MARK.sub(lambda m: f"{m[1]}\n{PARTS[m[2]](figures)}\n\n{m[3]}", text)
        path.write_text(made, "utf-8")
    make_folder(DOCS / "diagrams")
    for sensor in dict.fromkeys(p.sensor for p in figures.points):
        mine = [p for p in figures.points if p.sensor == sensor]
        save(f"front-{sensor}", 110.0, lambda figure, mine=mine: paint_depth_error(figure, mine))  # type: ignore[misc]
    save("integrators", 85.0, lambda figure: paint_integrators(figure, figures.integrators))


def save(name: str, height_mm: float, paint: Callable[[Any], None]) -> None:
    """Save a diagram as a small WebP image."""
    png = draw("", height_mm, paint).png
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    done, data = cv2.imencode(".webp", image, [cv2.IMWRITE_WEBP_QUALITY, 70])
    assert done
    (DOCS / "diagrams" / f"{name}.webp").write_bytes(data.tobytes())


def native(points: Sequence[Point]) -> int:
    """Return the widest size up to 1280 pixels, which every sensor has."""
    return max(p.width for p in points if p.width <= 1280)


def table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table in Markdown."""
    heads = tuple(heads)
    lines = [heads, ("---",) * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def short(value: float) -> str:
    """Return a number with two digits, without an exponent."""
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}" if value >= 1e-3 else "< 0.001"


def um(value: float | None) -> str:
    """Return an error, or that the method refused."""
    return "refused" if value is None else f"{value:.1f}"
