"""What the projects of open and of closed sensors share: outcomes of stages, and their age."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from gelpolight_core.calibration.editable_session import EditableSession
from gelpolight_core.calibration.inputs import Stage, StageInputs, changes_between
from gelpolight_core.calibration.status import StageState, StageStatus
from gelpolight_core.errors import InputError
from gelpolight_core.finding import QualityTable
from gelpolight_core.session.file_hashes import CachedHashes
from gelpolight_core.session.session import Session
from gelpolight_core.translation import tr

Results = TypeVar("Results")


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a stage ended when it was last computed.

    Attributes
    ----------
    inputs : StageInputs
        What it was computed from.
    fault : InputError or None
        Why it failed.
    """

    inputs: StageInputs
    fault: InputError | None


class StagedProject(EditableSession, Generic[Results]):
    """A session folder with the results of its stages.

    Parameters
    ----------
    folder : Path
        The session folder.
    read : callable
        Reads its description.
    results
        Results before any stage is computed.
    """

    def __init__(self, folder: Path, read: Callable[[Path], Session], results: Results) -> None:
        super().__init__(folder, read)
        self._hashes = CachedHashes()
        self._results = results
        self._outcomes: dict[Stage, Outcome] = {}

    @property
    def results(self) -> Results:
        """The newest result of every stage, even if out of date."""
        return self._results

    def fault(self, stage: Stage) -> InputError | None:
        """Return why a stage failed when it was last computed; None if it did not."""
        outcome = self._outcomes.get(stage)
        return None if outcome is None else outcome.fault

    def _is_current(self, stage: Stage, inputs: StageInputs) -> bool:
        outcome = self._outcomes.get(stage)
        return outcome is not None and outcome.inputs == inputs

    def _store(self, stage: Stage, outcome: Outcome, results: Results, dropped: int) -> None:
        # An image that was added and removed meanwhile may be in the result, but in no input.
        if self._dropped == dropped:
            if outcome.fault is None:
                self._results = results
            self._outcomes[stage] = outcome

    def _unfinished(self, stage: Stage, inputs: StageInputs) -> StageStatus | None:
        """Return the status of a computed stage that is out of date or failed; None otherwise."""
        outcome, nothing = self._outcomes[stage], QualityTable()
        if outcome.inputs != inputs:
            changes = "; ".join(changes_between(outcome.inputs, inputs))
            sentence = tr("Out of date: {changes}").format(changes=changes)
            return StageStatus(stage, StageState.STALE, sentence, nothing)
        if outcome.fault is not None:
            return StageStatus(stage, StageState.FAIL, str(outcome.fault), nothing)
        return None

    def _no_result(self, stage: Stage) -> InputError:
        return InputError(
            tr("The stage {stage} has no up-to-date result").format(stage=stage.value),
            where=str(self._session.folder),
            advice=tr("Complete the stages that are not done yet"),
        )
