"""Diagrams of error against time: both logarithmic, one diagram for each sensor."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gelpolight_core.experiments.front.measure import Point, fronts, measured
from gelpolight_core.experiments.log_axes import number_logarithmically
from gelpolight_core.report.document import Drawing
from gelpolight_core.report.drawing import draw
from gelpolight_core.translation import tr

PAPER_MS, PAPER_SIZE_PERCENT, PAPER_HEIGHT_PERCENT = 100.0, 5.0, 8.0
"""The paper's own figures: ten frames a second, errors of its section VI."""
STYLES = {
    "paper": ("#0072b2", "o"),
    "full_fast": ("#b7e08a", "^"),
    "full_balanced": ("#4caf50", "^"),
    "full_best": ("#00603b", "^"),
    "paper_plain": ("#56b4e9", "P"),
    "table": ("#d55e00", "s"),
    "polynomial": ("#e69f00", "D"),
    "network": ("#8a3ffc", "v"),
}
"""Colour and marker. A method with wrong eigenvalues has the hollow marker of its method."""
LEAST_ERROR = 1e-3


def draw_depth_error(points: Sequence[Point]) -> Drawing:
    """Show the depth error of one sensor against time."""
    return draw(
        tr(
            "Error of the depth against the time of a frame. A curve joins the image "
            "sizes of one method. Bars: quartiles over the presses, and from the "
            "median to the 95th percentile of the time. Black: the front of each "
            "size; methods above and to the right of it are slower and less accurate"
        ),
        110.0,
        lambda figure: paint_depth_error(figure, points),
    )


def paint_depth_error(figure: Figure, points: Sequence[Point]) -> None:
    """Draw the depth error of one sensor against time."""
    axes = figure.subplots()
    _curves(axes, points, "rms_um")
    for number, width in enumerate(dict.fromkeys(p.width for p in points)):
        points_shown = [measured(p) for p in fronts([p for p in points if p.width == width])]
        if not points_shown:
            continue
        axes.step(
            [ms for ms, _ in points_shown],
            [um for _, um in points_shown],
            where="post",
            color="black",
            lw=0.7,
            label=tr("front") if number == 0 else None,
        )
        axes.annotate(
            str(width),
            points_shown[0],
            fontsize=6,
            xytext=(-4, 4),
            textcoords="offset points",
            ha="right",
        ).set_in_layout(False)
    _label(axes, tr("depth, RMS (um)"))
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=6)


def draw_other_errors(points: Sequence[Point]) -> Drawing:
    """Show normals, plateau and size against time, with the paper's own figures."""
    panels = (
        ("normal_deg", tr("normals, RMS (deg)"), None),
        ("height_percent", tr("plateau height (%)"), PAPER_HEIGHT_PERCENT),
        ("size_percent", tr("size at half height (%)"), PAPER_SIZE_PERCENT),
    )

    def paint(figure: Figure) -> None:
        for axes, (key, label, paper) in zip(figure.subplots(1, 3), panels, strict=True):
            _curves(axes, points, key)
            if paper is not None:
                axes.plot(PAPER_MS, paper, "*", color="black", markersize=10)
            _label(axes, label)

    caption = tr(
        "The other errors against time, with the colours of the figure above. "
        "The star shows the values that the paper states for its sensor and "
        "machine"
    )
    return draw(caption, 75.0, paint)


def _curves(axes: Axes, points: Sequence[Point], key: str) -> None:
    for method in dict.fromkeys(p.method for p in points):
        known = [
            p
            for p in points
            if p.method == method and p.median_ms is not None and getattr(p, key) is not None
        ]
        if not known:
            continue
        wrong = method.endswith("_wrong")
        colour, marker = STYLES.get(method.removesuffix("_wrong"), ("#6b7785", "x"))
        errors = [max(getattr(p, key), LEAST_ERROR) for p in known]
        spread = None
        if key == "rms_um":
            low = [max(p.rms_low_um or 0.0, LEAST_ERROR) for p in known]
            high = [p.rms_high_um or 0.0 for p in known]
            spread = [
                [max(e - a, 0.0) for e, a in zip(errors, low, strict=True)],
                [max(b - e, 0.0) for e, b in zip(errors, high, strict=True)],
            ]
        axes.errorbar(
            [p.median_ms or 0.0 for p in known],
            errors,
            yerr=spread,
            xerr=[
                [0.0] * len(known),
                [max((p.p95_ms or 0.0) - (p.median_ms or 0.0), 0.0) for p in known],
            ],
            marker=marker,
            linestyle=":" if wrong else "-",
            color=colour,
            markerfacecolor="white" if wrong else colour,
            markersize=4,
            lw=0.9,
            elinewidth=0.5,
            label=known[0].label,
        )


def _label(axes: Axes, error: str) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    number_logarithmically(axes.xaxis)
    number_logarithmically(axes.yaxis)
    axes.grid(which="both", color="0.92", lw=0.5)
    axes.set_xlabel(tr("time of a frame (ms)"))
    axes.set_ylabel(error)
