"""Work-precision diagrams: error against time, log-log, a curve for each method."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gelpolight_core.experiments.integrators import IntegratorPoint
from gelpolight_core.experiments.log_axes import number_logarithmically
from gelpolight_core.experiments.work_precision import Point, measured, pareto_front
from gelpolight_core.report.document import Drawing
from gelpolight_core.report.drawing import draw
from gelpolight_core.translation import tr

PAPER_MS, PAPER_SIZE_PERCENT, PAPER_HEIGHT_PERCENT = 100.0, 5.0, 8.0
"""The paper's own figures: ten frames a second, errors of its section VI."""
FAMILIES = {
    "baseline": ("#d55e00", "s", "-"),
    "paper": ("#0072b2", "o", "-"),
    "effort": ("#009e73", "^", "-"),
    "term": ("#999999", "v", ":"),
    "threads": ("#56b4e9", "D", "--"),
    "precision": ("#cc79a7", "P", "--"),
}
INTEGRATOR_COLOURS = ("#d55e00", "#e69f00", "#0072b2", "#56b4e9", "#009e73", "#000000")
LEAST_ERROR = 1e-3


def draw_depth_error(points: Sequence[Point]) -> Drawing:
    """Show the depth's error against time, with the front that no method beats."""

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        _curves(axes, points, "rms_um")
        front = pareto_front(points)
        places = [measured(point) for point in front]
        axes.step(
            [ms for ms, _ in places],
            [um for _, um in places],
            where="post",
            color="black",
            lw=0.8,
            label=tr("front"),
        )
        for point, place in zip(front, places, strict=True):
            _name(axes, point.label, place)
        _label(axes, tr("depth, RMS (um)"))

    caption = tr(
        "Error of the depth against the time of a frame (median; the bar reaches to the 95th "
        "percentile). A curve joins the picture sizes of one method; the black line is the front: "
        "what lies above and to the right of it is beaten in both"
    )
    return draw(caption, 120.0, paint)


def draw_other_errors(points: Sequence[Point]) -> Drawing:
    """Show normals, plateau and size against time, with the paper's own figures."""
    panels = (
        ("normal_deg", tr("normals, RMS (deg)"), None),
        ("height_percent", tr("plateau height (%)"), PAPER_HEIGHT_PERCENT),
        ("size_percent", tr("size at half height (%)"), PAPER_SIZE_PERCENT),
    )

    def paint(figure: Figure) -> None:
        for axes, (key, label, paper) in zip(figure.subplots(1, 3), panels, strict=True):
            _curves(axes, points, key, names=False)
            if paper is not None:
                axes.plot(PAPER_MS, paper, "*", color="black", markersize=10)
                _name(axes, tr("the paper"), (PAPER_MS, paper))
            _label(axes, label, legend=False)

    caption = tr(
        "The other errors against time, in the colours of the figure above; the star is the "
        "paper's own statement, of its real sensor and machine"
    )
    return draw(caption, 75.0, paint)


def draw_integrators(points: Sequence[IntegratorPoint]) -> Drawing:
    """Show error against time of integration alone."""

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        names = list(dict.fromkeys(p.name for p in points))
        for colour, name in zip(INTEGRATOR_COLOURS, names, strict=False):
            mine = [p for p in points if p.name == name]
            axes.plot(
                [p.median_ms for p in mine],
                [p.rms_um for p in mine],
                "o-",
                color=colour,
                markersize=4,
                label=mine[0].label,
            )
            for point in mine:
                _name(axes, str(point.side), (point.median_ms, point.rms_um))
        _label(axes, tr("depth of a smooth bump of 1 mm, RMS (um)"), legend=False)
        axes.legend(loc="upper right", fontsize=6)

    caption = tr("Integration alone, of exact slopes; the numbers are nodes along each side")
    return draw(caption, 85.0, paint)


def _curves(axes: Axes, points: Sequence[Point], key: str, *, names: bool = True) -> None:
    for sensor, method in dict.fromkeys((_group(p), p.method) for p in points):
        mine = [p for p in points if (_group(p), p.method) == (sensor, method)]
        known = [p for p in mine if p.median_ms is not None and getattr(p, key) is not None]
        if not known:
            continue
        colour, marker, line = FAMILIES[known[0].family]
        times = [p.median_ms or 0.0 for p in known]
        errors = [max(getattr(p, key), LEAST_ERROR) for p in known]
        late = [(p.p95_ms or 0.0) - (p.median_ms or 0.0) for p in known]
        axes.errorbar(
            times,
            errors,
            xerr=[[0.0] * len(known), late],
            marker=marker,
            linestyle=line,
            color=colour,
            markersize=4,
            lw=0.9,
            elinewidth=0.5,
            label=known[0].label if names else None,
        )


def _name(axes: Axes, text: str, place: tuple[float, float]) -> None:
    """Write a name beside a point; it may leave the axes, which must not make room for it."""
    axes.annotate(
        text, place, fontsize=5.5, xytext=(3, 3), textcoords="offset points"
    ).set_in_layout(False)


def _group(point: Point) -> str:
    """Return what a curve joins: the sizes of the virtual sensor, or one session."""
    return point.sensor.split("-sensor-")[0]


def _label(axes: Axes, error: str, *, legend: bool = True) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    number_logarithmically(axes.xaxis)
    number_logarithmically(axes.yaxis)
    axes.grid(which="both", color="0.92", lw=0.5)
    axes.set_xlabel(tr("time of a frame (ms)"))
    axes.set_ylabel(error)
    if legend:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=6)
