"""The calibration in use: in the status of every page, and put into use from any of them."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtWidgets import QWidget

from app.widgets.dialog import QuestionDialog
from gelpolight_core.calibration.manifest import REMARK_LENGTH

from .calibration_entries import read_entry
from .context import AppContext

NOT_VALIDATED = (
    "This calibration is not validated. A wrong length in its session scales every result. "
    "Press an object of known size to validate it."
)


def show_in_use(context: AppContext) -> None:
    """Show the calibration in use in the state bar, and warn on every page if it failed."""
    path = context.workspace.in_use
    if path is None:
        context.status.update(sensor="", calibration="", calibration_role="")
        return
    used = read_entry(path, in_use=True)
    note, role = used.state
    advice = NOT_VALIDATED if role == "warn" else ""
    if role == "pass" and (trial := used.validation) is not None:
        note = f"{note} {trial.largest_percent:.1f} %"
        advice = f"Validated by {trial.basis}: largest error {trial.largest_percent:.2g} %"
    day = used.name if used.created is None else f"{used.created.astimezone():%Y-%m-%d}"
    if used.summary is not None and (fault := used.summary.fault):
        advice = (
            f"The calibration in use is not reliable: {fault.text}. Calibrate again, or use "
            "another calibration on the Sensors page."
        )
    context.status.update(
        sensor=used.serial,
        calibration=f"Calibration of {day}, {note}",
        calibration_role=role,
        calibration_advice=advice,
    )


def put_into_use(path: Path | None, parent: QWidget, *, context: AppContext) -> None:
    """Use a calibration, or none, from now on. One that failed asks for a reason first.

    Parameters
    ----------
    path : Path or None
        The calibration.
    parent : QWidget
        In front of it the question appears.
    context : AppContext
        Holds the workspace.
    """
    entry = None if path is None else read_entry(path)

    def act() -> None:
        done = False
        with context.toasts.errors():
            context.workspace.use(path)
            done = True
        context.requests.calibrations_changed.emit()
        if done and entry is not None and entry.state[1] == "warn":
            context.toasts.show("This calibration is not validated.", "warn")

    def accept() -> None:
        from gelpolight_core.calibration.annotations import write_reason  # slow import

        assert path is not None
        with context.toasts.errors():
            write_reason(line.text(), path)
            act()

    summary = None if entry is None else entry.summary
    if entry is None or summary is None or summary.fault is None or summary.accepted:
        act()
        return
    text = (
        f"{entry.name} is not reliable: {summary.fault.text}. Measurements with it are marked as "
        "doubtful. Enter the reason why you use it all the same: it is kept in the calibration "
        "file and in its report."
    )
    question = QuestionDialog(
        parent, "Use a failed calibration", text, (("Use it all the same", accept),)
    )
    line = question.require_text("Reason", REMARK_LENGTH)
    question.open()
