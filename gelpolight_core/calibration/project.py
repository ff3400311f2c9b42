"""A calibration being made: a session folder, its results, and which of them are out of date.

Results are computed from the files on disk. Two threads may use the project: one that captures and
decides, one that computes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from gelpolight_core.calibration.editable_session import EditableSession
from gelpolight_core.calibration.inputs import (
    FOLDERS,
    NEEDS,
    Stage,
    StageInputs,
    all_inputs,
    changes_between,
    inputs_of,
)
from gelpolight_core.calibration.pipeline import CalibrationRun, assemble, source_files, stages_of
from gelpolight_core.calibration.results import StageResults
from gelpolight_core.calibration.stages import run_stage
from gelpolight_core.calibration.status import StageState, StageStatus, judged
from gelpolight_core.errors import InputError
from gelpolight_core.quality import QualityTable
from gelpolight_core.sensor_calibration import MODELS
from gelpolight_core.session.file_hashes import CachedHashes, refuse_copies
from gelpolight_core.session.session import Session, read_session
from gelpolight_core.translation import tr


class Cancelled(Exception):
    """Raised in a computation that the user has stopped."""


@dataclass(frozen=True, slots=True)
class _Outcome:
    inputs: StageInputs
    fault: InputError | None


class CalibrationProject(EditableSession[Session]):
    """One session folder with its results.

    Parameters
    ----------
    folder : Path
        A session folder with ``session.toml``.

    Raises
    ------
    InputError
        If the folder is not a session.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, read_session)
        self._hashes = CachedHashes()
        self._results = StageResults()
        self._outcomes: dict[Stage, _Outcome] = {}

    @property
    def results(self) -> StageResults:
        """The newest result of every stage, even if out of date."""
        return self._results

    @property
    def all_inputs(self) -> str:
        """A text that changes with any input of the calibration."""
        with self._lock:
            return all_inputs(self._session, self._hashes)

    def statuses(self) -> dict[Stage, StageStatus]:
        """Return the present status of every stage."""
        with self._lock:
            inputs = inputs_of(self._session, self._hashes)
            return {stage: self._status(stage, inputs) for stage in Stage}

    def fault(self, stage: Stage) -> InputError | None:
        """Return why a stage failed when it was last computed; None if it did not."""
        outcome = self._outcomes.get(stage)
        return None if outcome is None else outcome.fault

    def stale(self, *, upto: Stage | None = None, model: str = MODELS[-1]) -> tuple[Stage, ...]:
        """Return the stages that can and need to be computed, in order.

        Parameters
        ----------
        upto : Stage, optional
            Only this stage and what it builds on.
        model : str, optional
            The model to calibrate for.
        """
        with self._lock:
            inputs = inputs_of(self._session, self._hashes)
        ready: set[Stage] = set()
        found = []
        wanted = set(stages_of(model)) if upto is None else _closure(upto)
        for stage in stages_of(model):
            if stage not in wanted or not all(need in ready for need in NEEDS[stage]):
                continue
            if stage in FOLDERS and not inputs[stage].images:
                continue
            outcome = self._outcomes.get(stage)
            current = outcome is not None and outcome.inputs == inputs[stage]
            if current and outcome is not None and outcome.fault is not None:
                continue
            ready.add(stage)
            if not current:
                found.append(stage)
        return tuple(found)

    def compute(self, stage: Stage, tell: Callable[[float], None] | None = None) -> StageStatus:
        """Run one stage on the present images and decisions, and store its result.

        A stage that cannot be completed stores its error as its status. A stage whose earlier
        stages must be computed first does not change.

        Parameters
        ----------
        stage : Stage
            The stage.
        tell : callable, optional
            Called with the share done; it may raise :class:`Cancelled`, which leaves everything
            unchanged.
        """
        with self._lock:
            session, results, dropped = self._session, self._results, self._dropped
            inputs = inputs_of(session, self._hashes)
            for earlier in NEEDS[stage]:
                outcome = self._outcomes.get(earlier)
                if outcome is not None and outcome.inputs != inputs[earlier]:
                    return self._status(stage, inputs)
        fault = None
        try:
            results = run_stage(stage, session, results, tell=tell)
        except InputError as error:
            fault = error
        with self._lock:
            # An image that was added and removed meanwhile may be in the result, but in no input.
            if self._dropped == dropped:
                if fault is None:
                    self._results = results
                self._outcomes[stage] = _Outcome(inputs[stage], fault)
            return self._status(stage, inputs_of(self._session, self._hashes))

    def finish(self, *, model: str = MODELS[-1]) -> CalibrationRun:
        """Return the calibration.

        Raises
        ------
        InputError
            If a stage is missing, out of date or failed.
        """
        with self._lock:
            for stage, status in self.statuses().items():
                if stage not in stages_of(model):
                    continue
                if status.state in (StageState.EMPTY, StageState.WAITING, StageState.STALE):
                    raise InputError(
                        tr("The stage {stage} has no up-to-date result").format(stage=stage.value),
                        where=str(self._session.folder),
                        advice=tr("Complete the stages that are not done yet"),
                    )
                fault = self.fault(stage)
                if fault is not None:
                    raise fault
            session, results = self._session, self._results
        refuse_copies(source_files(session))
        return assemble(session, results, model=model)

    def _status(self, stage: Stage, inputs: Mapping[Stage, StageInputs]) -> StageStatus:
        outcome = self._outcomes.get(stage)
        nothing = QualityTable()
        if stage in FOLDERS and not inputs[stage].images:
            return StageStatus(stage, StageState.EMPTY, tr("No images captured yet"), nothing)
        if outcome is None:
            missing = [need for need in NEEDS[stage] if need not in self._outcomes]
            sentence = tr("Not computed yet")
            if missing:
                sentence = tr("Waiting for an earlier stage")
            empty = stage not in FOLDERS and missing
            state = StageState.EMPTY if empty else StageState.WAITING
            return StageStatus(stage, state, sentence, nothing)
        if outcome.inputs != inputs[stage]:
            sentence = tr("Out of date: {changes}").format(
                changes="; ".join(changes_between(outcome.inputs, inputs[stage]))
            )
            return StageStatus(stage, StageState.STALE, sentence, nothing)
        if outcome.fault is not None:
            return StageStatus(stage, StageState.FAIL, str(outcome.fault), nothing)
        return judged(stage, self._results)


def _closure(stage: Stage) -> set[Stage]:
    found = {stage}
    for need in NEEDS[stage]:
        found |= _closure(need)
    return found
