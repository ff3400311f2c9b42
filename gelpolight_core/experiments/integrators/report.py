"""Integrators as a section of the report."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from gelpolight_core.experiments.integrators.measure import IntegratorPoint, integrator_order
from gelpolight_core.experiments.log_axes import number_logarithmically
from gelpolight_core.quality import QualityTable
from gelpolight_core.report.document import Drawing, Listing, Section
from gelpolight_core.report.drawing import draw
from gelpolight_core.translation import tr

STYLES = {
    "sine_4": ("#009e73", "^"),
    "weighted": ("#00603b", "o"),
    "bilateral": ("#8a3ffc", "v"),
    "sine_2": ("#b7e08a", "^"),
    "sine_1": ("#999999", "^"),
    "cosine": ("#0072b2", "s"),
    "fourier": ("#e69f00", "D"),
    "sparse": ("#56b4e9", "P"),
    "shifted": ("#d55e00", "x"),
}
LEAST_UM = 1e-5


def integrator_section(points: Sequence[IntegratorPoint]) -> Section:
    """Return the section: a diagram of convergence, and a table of all surfaces."""
    title = tr("Integration alone")
    drawing, listing = draw_integrators(points), _listing(points)
    return Section("integrators", title, "", QualityTable(), (), (drawing,), (listing,))


def draw_integrators(points: Sequence[IntegratorPoint]) -> Drawing:
    """Show error against time on the smooth bump."""
    caption = tr(
        "Integration alone, of exact slopes of a smooth bump of 1 mm: mean error against time. "
        "The numbers are nodes along each side"
    )
    return draw(caption, 85.0, lambda figure: paint_integrators(figure, points))


def paint_integrators(figure: Figure, points: Sequence[IntegratorPoint]) -> None:
    """Draw error against time on the smooth bump."""
    axes = figure.subplots()
    for name in dict.fromkeys(p.name for p in points):
        mine = sorted(
            (p for p in points if p.name == name and p.scene == "bump"), key=lambda p: p.side
        )
        colour, marker = STYLES[name]
        shown = [(p.median_ms, max(p.mean_um, LEAST_UM)) for p in mine]
        axes.plot(
            *zip(*shown, strict=True),
            marker=marker,
            color=colour,
            markersize=4,
            lw=0.9,
            label=mine[0].label,
        )
        for point, at in ((mine[0], shown[0]), (mine[-1], shown[-1])):
            axes.annotate(
                str(point.side), at, fontsize=5.5, xytext=(3, 3), textcoords="offset points"
            ).set_in_layout(False)
    axes.set_xscale("log")
    axes.set_yscale("log")
    number_logarithmically(axes.xaxis)
    number_logarithmically(axes.yaxis)
    axes.grid(which="both", color="0.92", lw=0.5)
    axes.set_xlabel(tr("time (ms)"))
    axes.set_ylabel(tr("mean error (um)"))
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=6)


def _listing(points: Sequence[IntegratorPoint]) -> Listing:
    rows = []
    for p in points:
        order = integrator_order(points, p.name) if p.scene == "bump" else None
        rows.append(
            (
                p.scene_label,
                p.label,
                str(p.side),
                f"{p.median_ms:.2f}",
                f"{p.p95_ms:.2f}",
                f"{p.mean_um:.2g}",
                f"{p.middle_um:.2g}",
                "" if order is None else order.text,
            )
        )
    heads = (
        tr("Surface"),
        tr("Integrator"),
        tr("Nodes"),
        "ms",
        "p95 ms",
        tr("Mean um"),
        tr("Median um"),
        tr("Order"),
    )
    return Listing("", heads, tuple(rows), (2.5, 3.5, *(1.0,) * 5, 1.6))
