"""What can be done with the calibrations of the library, and what the person is told of it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from app.shell.context import AppContext
from app.workspace.entries import Entry
from app.workspace.sessions import SessionEntry
from app.workspace.workspace import Removal
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr


class CalibrationActions:
    """Changes the workspace; every refusal becomes a message."""

    def __init__(self, context: AppContext) -> None:
        self._context = context

    def entries(self) -> tuple[Entry, ...]:
        """Return all calibrations; none where the workspace cannot be read, which is told."""
        try:
            return self._context.workspace.entries()
        except InputError as error:
            self._context.toasts.show(str(error), "fail")
            return ()

    def sessions(self) -> tuple[SessionEntry, ...]:
        """Return all sessions; none where the workspace cannot be read, which is told."""
        try:
            return self._context.workspace.sessions()
        except InputError as error:
            self._context.toasts.show(str(error), "fail")
            return ()

    def import_files(self, files: Iterable[Path]) -> Path | None:
        """Copy calibration files into the library; return the last one's place."""
        place = None
        for file in files:
            try:
                place = self._context.workspace.import_calibration(file)
            except InputError as error:
                self._context.toasts.show(str(error), "fail")
                continue
            self._context.toasts.show(
                tr("{name} is in the library of sensor {serial}.").format(
                    name=place.name, serial=place.parent.name
                ),
                "pass",
            )
        if place is not None:
            self._context.requests.calibrations_changed.emit()
        return place

    def use(self, entry: Entry) -> None:
        """Measure with this calibration from now on."""
        try:
            self._context.workspace.use(entry.path)
        except InputError as error:
            self._context.toasts.show(str(error), "fail")
            return
        self._context.requests.calibrations_changed.emit()
        if not entry.validated:
            self._context.toasts.show(
                tr(
                    "This calibration is not validated: a wrong length in its session scales every "
                    "result. Press an object of known size before you trust it."
                ),
                "warn",
            )

    def remove(self, entry: Entry) -> None:
        """Move a calibration into the trash, and offer to take that back."""
        try:
            removal = self._context.workspace.remove(entry.path)
        except InputError as error:
            self._context.toasts.show(str(error), "fail")
            return
        self._context.requests.calibrations_changed.emit()
        self._context.toasts.show(
            tr("{name} was moved to the trash folder.").format(name=entry.path.name),
            actions=((tr("Undo"), lambda: self._restore(removal)),),
        )

    def _restore(self, removal: Removal) -> None:
        try:
            self._context.workspace.restore(removal)
        except InputError as error:
            self._context.toasts.show(str(error), "fail")
        self._context.requests.calibrations_changed.emit()


def show_in_use(context: AppContext, entries: Iterable[Entry]) -> None:
    """Say in the status bar which calibration is in use."""
    used = next((entry for entry in entries if entry.in_use), None)
    if used is None:
        context.status.update(calibration=None, calibration_note="")
        return
    note = tr("validated") if used.validated else tr("not validated")
    context.status.update(
        calibration=used.path.stem if used.summary is None else used.summary.identity,
        calibration_note=tr("broken") if used.broken else note,
    )
