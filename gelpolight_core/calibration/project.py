"""A calibration being made: a session folder, its results, and which of them are out of date.

Results are computed from the files on disk. Two threads may use the project: one that captures and
decides, one that computes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from gelpolight_core.calibration.inputs import (
    FOLDERS,
    NEEDS,
    Stage,
    StageInputs,
    all_inputs,
    inputs_of,
)
from gelpolight_core.calibration.pipeline import CalibrationRun, assemble, source_files, stages_of
from gelpolight_core.calibration.results import StageResults
from gelpolight_core.calibration.staged_project import Outcome, StagedProject
from gelpolight_core.calibration.stages import run_stage
from gelpolight_core.calibration.status import StageState, StageStatus, judged
from gelpolight_core.errors import InputError
from gelpolight_core.finding import QualityTable
from gelpolight_core.sensor_calibration import MODELS
from gelpolight_core.session.file_hashes import refuse_copies
from gelpolight_core.session.session import read_session
from gelpolight_core.translation import tr


class Cancelled(Exception):
    """Raised in a computation that the user has stopped."""


class CalibrationProject(StagedProject[StageResults]):
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
        super().__init__(folder, read_session, StageResults())

    @property
    def all_inputs(self) -> str:
        """A text that changes with any input of the calibration."""
        with self._lock:
            return all_inputs(self._session, self._hashes)

    def statuses(self) -> dict[Stage, StageStatus]:
        """Return the present status of every stage."""
        with self._lock:
            inputs = inputs_of(self._session, self._hashes)
            return {stage: self._status(stage, inputs) for stage in inputs}

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
            current = self._is_current(stage, inputs[stage])
            if current and self.fault(stage) is not None:
                continue
            ready.add(stage)
            if not current:
                found.append(stage)
        return tuple(found)

    def compute(self, stage: Stage, progress: Callable[[float], None] | None = None) -> StageStatus:
        """Run one stage on the present images and decisions, and store its result.

        A stage that cannot be completed stores its error as its status. A stage whose earlier
        stages must be computed first does not change.

        Parameters
        ----------
        stage : Stage
            The stage.
        progress : callable, optional
            Called with the share done; it may raise :class:`Cancelled`, which leaves everything
            unchanged.
        """
        with self._lock:
            session, results, dropped = self._session, self._results, self._dropped
            inputs = inputs_of(session, self._hashes)
            for earlier in NEEDS[stage]:
                if earlier in self._outcomes and not self._is_current(earlier, inputs[earlier]):
                    return self._status(stage, inputs)
        fault = None
        try:
            results = run_stage(stage, session, results, progress=progress)
        except InputError as error:
            fault = error
        with self._lock:
            self._store(stage, Outcome(inputs[stage], fault), results, dropped)
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
                    raise self._no_result(stage)
                fault = self.fault(stage)
                if fault is not None:
                    raise fault
            session, results = self._session, self._results
        refuse_copies(source_files(session))
        return assemble(session, results, model=model)

    def _status(self, stage: Stage, inputs: Mapping[Stage, StageInputs]) -> StageStatus:
        nothing = QualityTable()
        if stage in FOLDERS and not inputs[stage].images:
            return StageStatus(stage, StageState.EMPTY, tr("No images captured yet"), nothing)
        if stage not in self._outcomes:
            missing = [need for need in NEEDS[stage] if need not in self._outcomes]
            sentence = tr("Not computed yet")
            if missing:
                sentence = tr("Waiting for an earlier stage")
            empty = stage not in FOLDERS and missing
            state = StageState.EMPTY if empty else StageState.WAITING
            return StageStatus(stage, state, sentence, nothing)
        return self._unfinished(stage, inputs[stage]) or judged(stage, self._results)


def _closure(stage: Stage) -> set[Stage]:
    found = {stage}
    for need in NEEDS[stage]:
        found |= _closure(need)
    return found
