"""What the Measure page shows of a press, from its work and the reference. Without widgets."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from app.live.next_step_advice import PREPARING, LiveState, advise
from app.program.preferences import WarningLimits
from gelpolight_core.base.compared_quantity import (
    SOURCES,
    Quantity,
    decimals_for,
    readable_unit,
    unit_behind,
)
from gelpolight_core.base.finding import Finding, Verdict
from gelpolight_core.lab.measurement_record import verdict_of
from gelpolight_core.measurement.measured_value import named
from gelpolight_core.measurement.tools.tool_base import ToolResult
from gelpolight_core.measurement.tools.tool_registry import palette_entry
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.session.reference_object import ReferenceObject

from .measurement_model import MeasurementModel
from .record_table import VERDICTS, verdict_role
from .reference_comparison import doubts_of, quantities_of

FIGURE_SPACE, POINT_SPACE = "\N{FIGURE SPACE}", "\N{PUNCTUATION SPACE}"
"""As wide as a digit and as the decimal point."""
EXPANDED = "U (k = 2)"


@dataclass(frozen=True, slots=True)
class ResultRow:
    """Texts of a measured value, a reference and a deviation, lengths in the unit in use."""

    label: str
    measured: str
    sd: str
    reference: str = ""
    deviation: str = ""
    percent: str = ""
    role: str = ""
    decision: str = ""


@dataclass(frozen=True, slots=True)
class PressState:
    """What the page shows of a press.

    Attributes
    ----------
    frozen : bool
        Whether an image is frozen or opened.
    earlier : bool
        Whether the sensor shows another press than the frozen image.
    measurable : bool
        Whether there is a height map to measure on.
    freezable : bool
        Whether a live height map can be frozen.
    reconstructing, detecting : bool
        Work in progress.
    title, image : str
        The chosen tool and the name of the image.
    kind, asked, unit : str
        Name of the chosen tool, and the figure that has a reference. Empty if there is none.
    verdict, verdict_role : str
        Word and role of the verdict. Empty without a result or a true value.
    rows : tuple of ResultRow
        The figures of the chosen tool.
    budget : tuple of tuple of str
        Where the uncertainty of the sizes comes from: a table, its heads first.
    reason, role : str
        Why there is no result or a doubtful one, and the meaning of the text.
    """

    frozen: bool
    earlier: bool
    measurable: bool
    freezable: bool
    reconstructing: bool
    detecting: bool
    title: str = ""
    image: str = ""
    kind: str = ""
    asked: str = ""
    unit: str = "mm"
    verdict: str = ""
    verdict_role: str = ""
    rows: tuple[ResultRow, ...] = ()
    budget: tuple[tuple[str, ...], ...] = ()
    reason: str = ""
    role: str = "muted"


def resolve_press(
    work: MeasurementModel,
    reference: ReferenceObject,
    limits: WarningLimits,
    *,
    freezable: bool,
    earlier: bool,
) -> PressState:
    """Return what the page shows.

    Parameters
    ----------
    work : MeasurementModel
        The image and the tools on it.
    reference : ReferenceObject
        The true values of the chosen tool.
    limits : WarningLimits
        Limits of the verdict.
    freezable, earlier : bool
        As in the state.
    """
    tool, answer = work.tool, work.answer_of(work.chosen)
    state = PressState(
        frozen=work.image is not None,
        earlier=earlier,
        measurable=work.heightmap is not None or freezable,
        freezable=freezable,
        reconstructing=work.image is not None and work.heightmap is None and work.busy,
        detecting=work.detecting,
        image="" if work.image is None else work.image.name + _zero_of(work.heightmap),
        title="" if tool is None else palette_entry(tool.name).label,
        kind="" if tool is None else tool.name,
    )
    if (result := answer.result) is not None:
        first = result.figures[0]
        asked = first.label[:1].upper() + first.label[1:]
        state = replace(state, asked=asked, unit=first.unit)
        if result.tool == tool:
            return _with_result(state, result, reference, quantities_of(result, reference, limits))
    if answer.refused:  # why an image cannot be measured is in the banner
        return replace(state, reason=answer.refused, role="fail")
    return replace(state, reason="Measuring…" if tool and state.measurable else "")


def _zero_of(heightmap: HeightMap | None) -> str:
    """Return from where a depth counts, if that is not a plane."""
    is_flat = heightmap is None or heightmap.at_rest.flat
    return "" if is_flat else "\nThe depth counts from the curved membrane at rest."


def _with_result(
    state: PressState,
    result: ToolResult,
    reference: ReferenceObject,
    quantities: tuple[Quantity, ...],
) -> PressState:
    doubtful = bool(doubts_of(result, reference))
    word, role = VERDICTS.get(verdict_of(quantities, doubtful=doubtful), ("", ""))
    rows = [_row(*pair, doubtful=doubtful) for pair in named(result.figures, quantities)]
    reasons = [f"Doubtful: {result.reason}"] if result.findings else []
    reasons += [finding.line for finding in reference.findings()]
    return replace(
        state,
        verdict=word,
        verdict_role=verdict_role(role, *quantities),
        rows=tuple(_aligned(rows)),
        budget=_budget([quantity for quantity in quantities if quantity.parts]),
        reason="\n".join(reasons),
        role="warn" if reasons else "muted",
    )


def _budget(known: list[Quantity]) -> tuple[tuple[str, ...], ...]:
    """Return the budgets of lengths as a table, with their expanded uncertainties below."""
    if not known:
        return ()
    rows = [{**dict(quantity.budget), EXPANDED: quantity.deviation_expanded} for quantity in known]
    names = (quantity.label for quantity in known)
    sources = sorted(dict.fromkeys(source for row in rows for source in row), key=EXPANDED.__eq__)
    unit, factor = readable_unit(*(row[EXPANDED] for row in rows))
    digits = decimals_for(factor * min(row[EXPANDED] for row in rows) / 10.0, unit)
    body = (
        (SOURCES.get(s, s), *(f"{factor * row[s]:.{digits}f}" if s in row else "" for row in rows))
        for s in sources
    )
    return ((unit_behind(unit).strip(), *names), *body)


def _row(label: str, quantity: Quantity, *, doubtful: bool) -> ResultRow:
    unit, factor = quantity.unit, 1.0
    if unit == "mm":
        unit, factor = readable_unit(quantity.value, quantity.truth or 0.0)
    sd = None if quantity.sd is None else factor * quantity.sd
    digits = decimals_for(sd, unit)
    behind = "" if unit == "mm" else f" ({unit_behind(unit).strip()})"
    row = ResultRow(
        label[:1].upper() + label[1:] + behind,
        f"{factor * quantity.value:.{digits}f}",
        "" if sd is None else f"± {sd:.{digits}f}",
    )
    if quantity.truth is None or quantity.error is None or quantity.error_percent is None:
        return row
    return replace(
        row,
        reference=f"{factor * quantity.truth:.{digits}f}",
        deviation=f"{factor * quantity.error:+z.{digits}f}",
        percent=f"{quantity.error_percent:+z.2f} %",
        role=verdict_role(quantity.verdict or "", quantity, doubtful=doubtful),
        decision=quantity.judgement,
    )


def _aligned(rows: list[ResultRow]) -> Iterator[ResultRow]:
    """Return rows whose numbers have their points one below the other, if they end together."""
    most = max((_digits(row.measured) for row in rows), default=0)
    for row in rows:
        digits = _digits(row.measured)
        space = FIGURE_SPACE * (most - digits) + (POINT_SPACE if most and not digits else "")
        numbers = {
            name: text + space
            for name in ("measured", "sd", "reference", "deviation")
            if (text := getattr(row, name))
        }
        yield replace(row, **numbers)


def _digits(number: str) -> int:
    return len(number.partition(".")[2])


def advice_of(
    now: LiveState, state: PressState, *, refused: str, findings: tuple[Finding, ...] = ()
) -> Finding | None:
    """Return what to do next.

    Parameters
    ----------
    now : LiveState
        State of the live image.
    state : PressState
        What is shown.
    refused : str
        Why the frozen image cannot be measured. Empty if it can.
    findings : tuple of Finding
        About its height map.
    """
    if now.used is None and (state.frozen or not now.kind):
        if now.reading:
            return PREPARING
        text = "No calibration is in use. Depth cannot be measured without one."
        return Finding("sensors", text)
    if state.frozen and refused:
        other = advise(now)
        fits = other is not None and other.key == "fitting"
        return Finding("fitting" if fits else "live", refused, verdict=Verdict.FAIL)
    if state.earlier:
        text = "The image shows an earlier press. The sensor shows another one now."
        return Finding("live", text, verdict=Verdict.WARN)
    if state.frozen:
        text = " ".join(finding.line for finding in findings)
        return Finding("height_map", text, verdict=Verdict.WARN) if text else None
    if not now.kind:
        text = "No camera is selected. Choose one, open an image, or try the virtual sensor."
        return Finding("virtual", text)
    if (live := advise(now)) is not None:
        return live
    if now.kind == "virtual":
        text = "Place a ball, cylinder or cuboid on the virtual bench. It is then pressed in."
    else:
        text = "Press an object into the membrane and hold it still."
    return Finding("press", text)
