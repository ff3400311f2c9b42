"""The explanation of a session's errors as text and CSV."""

from __future__ import annotations

import csv
import io
from dataclasses import asdict
from pathlib import Path

from gelpolight_core.experiments.explain import Explanation, Light, Loss
from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.translation import tr


def explanation_text(explanation: Explanation) -> str:
    """Return the explanation as lines of text."""
    lines = [
        tr("{sensor}: {n} presses").format(sensor=explanation.sensor, n=len(explanation.losses)),
        "",
        tr("Height error, percent, with parts of the solution replaced by the truth"),
        f"{tr('press'):<28}{tr('found'):>8}{tr('all true'):>10}{tr('true, dark'):>12}"
        f"{tr('true, lit'):>11}",
    ]
    lines += [
        f"{x.file:<28}{x.found:>8.2f}{x.true_slopes:>10.2f}{x.true_where_dark:>12.2f}"
        f"{x.true_where_lit:>11.2f}"
        for x in explanation.losses
    ]
    lines += [
        "",
        tr("Press over background at the true surface, medians"),
        f"{tr('side'):<10}{tr('slope, deg'):<12}{tr('image'):>8}{tr('direct'):>9}{tr('left'):>8}"
        f"{tr('model'):>8}{tr('gathered'):>10}{tr('values'):>9}",
    ]
    lines += [
        f"{x.side:<10}{f'{x.low_deg:.0f}-{x.high_deg:.0f}':<12}{x.seen:>8.3f}{x.direct:>9.3f}"
        f"{x.left:>8.3f}{x.model:>8.3f}{x.gathered:>10.3f}{x.nodes:>9}"
        for x in explanation.light
    ]
    lines += [
        "",
        tr(
            "Reflectance that explains the difference: {needed:.2f}; measured: "
            "{seen:.2f} of the white board's"
        ).format(needed=explanation.reflectance_needed, seen=explanation.reflectance_seen),
    ]
    return "\n".join(lines)


def write_explanation(explanation: Explanation, folder: Path) -> tuple[Path, Path]:
    """Write ``height.csv`` and ``light.csv``; return their paths.

    Parameters
    ----------
    explanation : Explanation
        To be written.
    folder : Path
        An existing folder.
    """
    height, light = folder / "height.csv", folder / "light.csv"
    _write(height, explanation.losses)
    _write(light, explanation.light)
    return height, light


def _write(path: Path, rows: tuple[Loss, ...] | tuple[Light, ...]) -> None:
    text = io.StringIO()
    records = [asdict(row) for row in rows]
    if records:
        table = csv.DictWriter(text, list(records[0]), lineterminator="\n")
        table.writeheader()
        table.writerows(records)
    write_atomically(path, lambda out: out.write(text.getvalue().encode("utf-8")))
