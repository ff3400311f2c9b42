"""A calibration being made: a session folder with its present and outdated results.

Results are computed from the files on disk. Two threads may use the project: one that captures and
decides, one that computes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.root_causes import cause_and_rest
from gelpolight_core.base.safe_reading import escape_undecodable
from gelpolight_core.base.user_name import user_name
from gelpolight_core.base.version import __version__
from gelpolight_core.sensor.sensor_calibration import Provenance
from gelpolight_core.session.decisions import FILE_NAME as DECISIONS_FILE
from gelpolight_core.session.file_hashes import file_hash
from gelpolight_core.session.inventory import DESCRIPTION, StoredImage
from gelpolight_core.session.session import Session

from .editable_session import EditableSession
from .height_limits import TOLERANCE_PERCENT, judged_for
from .image_checks import judge_image_files, refuse_copies
from .recipe import (
    FILES,
    ProgressCallback,
    Recipe,
    Stage,
    StageContext,
    StageInputs,
    StageResults,
    settled,
)
from .recipes import recipe_of, refuse_missing, session_to_calibrate
from .stage_status import StageState, StageStatus, judged_by


def provenance_of(
    session: Session, images: Iterable[StoredImage], *, inputs: str = ""
) -> Provenance:
    """Return the provenance of a calibration that is made now.

    Parameters
    ----------
    session : Session
        With its folder and camera settings.
    images : iterable of StoredImage
        The images that were used.
    inputs : str, optional
        Hash of all inputs.
    """
    folder, camera = session.folder, session.camera_settings
    described = (folder / name for name in (DESCRIPTION, DECISIONS_FILE))
    sources = {escape_undecodable(image.name): image.sha256 for image in images}
    sources |= {path.name: file_hash(path) for path in described if path.is_file()}
    return Provenance(
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        operator=user_name(),
        program_version=__version__,
        session=escape_undecodable(folder.resolve().name),
        sources=sources,
        inputs=inputs,
        camera_settings={} if camera is None else camera.as_texts(),
    )


if TYPE_CHECKING:
    from gelpolight_core.image.grain import Grain
    from gelpolight_core.sensor.sensor_calibration import Calibration


class Cancelled(Exception):
    """Raised in a computation that the user has stopped."""


@dataclass(frozen=True, slots=True)
class CalibrationRun:
    """A calibration with what it was made from, as shown by the wizard and the report.

    Attributes
    ----------
    calibration : Calibration
        What was made.
    session : Session
        Its images, as they were used.
    results : StageResults
        The result of every stage.
    """

    calibration: Calibration
    session: Session
    results: StageResults


def run_calibration(
    session: Session,
    recipe: Recipe | None = None,
    *,
    progress: Callable[[str, float], None] | None = None,
    tolerance_percent: float = TOLERANCE_PERCENT,
) -> CalibrationRun:
    """Calibrate a sensor from its session folder, all stages in order.

    Parameters
    ----------
    session : Session
        Captured images and the user's decisions.
    recipe : Recipe, optional
        The stages; by default those of the session's kind of sensor.
    progress : callable, optional
        Called with the title of the stage and the share done, 0..1.
    tolerance_percent : float, optional
        Tolerance of heights, by which the verdict judges their uncertainty.

    Raises
    ------
    InputError
        If a stage is missing or cannot be used; the message names the file.
    """
    recipe, show = recipe or recipe_of(session), progress or (lambda _title, _share: None)
    refuse_missing(session, recipe.missing(session))
    refuse_copies(recipe.files(session))
    results, inputs, begin = StageResults(), recipe.inputs(session), 0.0
    whole = sum(stage.share for stage in recipe.of(session))
    for stage in recipe.of(session):

        def within(done: float, stage: Stage[Any] = stage, begin: float = begin) -> None:
            show(stage.title, begin + stage.share / whole * done)

        within(0.0)
        results = run_stage(recipe, stage, session, results, inputs=inputs, progress=within)
        stage.require(results)
        begin += stage.share / whole
    show("done", 1.0)
    return assemble(recipe, session, results, inputs, tolerance_percent)


def run_stage(
    recipe: Recipe,
    stage: Stage[Any],
    session: Session,
    results: StageResults,
    *,
    inputs: Mapping[str, StageInputs] | None = None,
    progress: ProgressCallback = lambda _share: None,
) -> StageResults:
    """Run one stage and add its result. Arguments are as in :class:`StageContext`."""
    inputs = recipe.inputs(session) if inputs is None else inputs
    return results.having(stage, stage.run(StageContext(session, results, inputs, progress)))


def assemble(
    recipe: Recipe,
    session: Session,
    results: StageResults,
    inputs: Mapping[str, StageInputs] | None = None,
    tolerance_percent: float = TOLERANCE_PERCENT,
) -> CalibrationRun:
    """Combine the results of all stages.

    Parameters
    ----------
    recipe, session
        The stages, and what they were computed from.
    results : StageResults
        Results of every stage.
    inputs : mapping, optional
        Inputs of every stage, by its key; by default the present ones.
    tolerance_percent : float, optional
        As for :func:`run_calibration`.

    Raises
    ------
    InputError
        If a stage was not run.
    """
    tables = {
        table.key: table.of(results[stage])
        for stage in recipe.of(session)
        for table in stage.all_tables
    }
    tables[FILES.key] = judge_image_files(session, recipe.folders(session))
    tables = judged_for(settled(tables, recipe.of(session)), tolerance_percent)
    quality = {key: table for key, table in tables.items() if table.figures}
    text = recipe.all_inputs(session, inputs or recipe.inputs(session))
    provenance = provenance_of(session, recipe.files(session), inputs=text)
    calibration = recipe.finish(session, results, quality, provenance)
    grain = _grain_of_presses(calibration, session)
    return CalibrationRun(calibration.changed(grain=grain), session, results)


def _grain_of_presses(calibration: Calibration, session: Session) -> Grain | None:
    """Return the grain of the images of the ball presses, which are single frames."""
    from gelpolight_core.health.health_samples import choose_samples
    from gelpolight_core.image.grain import grain_of

    images, _ = session.usable_images("balls")
    bad = calibration.data.bad_pixels
    return grain_of(
        [bad.fill_bad_pixels(i.rgb) for i in images], choose_samples(calibration.data).blocks
    )


@dataclass(frozen=True, slots=True)
class StageOutcome:
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


class CalibrationProject(EditableSession):
    """One session folder with the results of its recipe's stages, which are named by their keys.

    Parameters
    ----------
    folder : Path
        A session folder with ``session.toml``.
    recipe : Recipe, optional
        The stages; by default those of the session's kind of sensor.
    tolerance_percent : float, optional
        As for :func:`run_calibration`.

    Raises
    ------
    InputError
        If the folder is not a session, or not one of the recipe.
    """

    def __init__(
        self,
        folder: Path,
        recipe: Recipe | None = None,
        tolerance_percent: float = TOLERANCE_PERCENT,
    ) -> None:
        super().__init__(folder, recipe or recipe_of(session_to_calibrate(folder)))
        self._tolerance_percent = tolerance_percent
        self._results = StageResults()
        self._outcomes: dict[str, StageOutcome] = {}

    @property
    def results(self) -> StageResults:
        """The newest result of every stage, even if out of date."""
        return self._results

    @property
    def all_inputs(self) -> str:
        """A text that changes with any input of the calibration."""
        with self._lock:
            return self.recipe.all_inputs(self._session, self._inputs())

    def fault(self, key: str) -> InputError | None:
        """Return the error of a stage in its last computation, or None."""
        outcome = self._outcomes.get(key)
        return None if outcome is None else outcome.fault

    def statuses(self) -> dict[str, StageStatus]:
        """Return the present status of every stage, by its key."""
        with self._lock:
            inputs = self._inputs()
            stages = self.recipe.of(self._session)
            statuses = {stage.key: self._status(stage, inputs[stage.key]) for stage in stages}
        quality = {key: status.quality for key, status in statuses.items()}
        judged = [stage for stage in stages if quality[stage.key].figures]
        found = judged_for(settled(quality, judged), self._tolerance_percent)
        cause, tables = cause_and_rest(found)
        for key, table in tables.items():
            if table.figures and (cause or table != quality[key]):
                statuses[key] = judged_by(table, cause=cause)
        return statuses

    def stale(self, *, upto: str | None = None) -> tuple[str, ...]:
        """Return the keys of the stages that can and need to be computed, in order.

        Parameters
        ----------
        upto : str, optional
            Only this stage and what it builds on.
        """
        with self._lock:
            inputs, stages = self._inputs(), self.recipe.of(self._session)
        ready: set[str] = set()
        stale_keys = []
        for stage in stages:
            key, is_requested = stage.key, upto is None or stage.key in self.recipe.needed(upto)
            empty = stage.folder and not inputs[key].images
            waits = any(n.key in inputs and n.key not in ready for n in stage.needs)
            if not is_requested or empty or waits:
                continue
            current = self._is_current(key, inputs[key])
            if current and self.fault(key) is not None:
                continue
            ready.add(key)
            if not current:
                stale_keys.append(key)
        return tuple(stale_keys)

    def compute(self, key: str, progress: ProgressCallback = lambda _share: None) -> StageStatus:
        """Run one stage on the present images and decisions, and store its result.

        A stage that cannot be completed stores its error as its status. A stage whose earlier
        stages must be computed first does not change.

        Parameters
        ----------
        key : str
            The stage.
        progress : callable, optional
            Called with the share done; it may raise :class:`Cancelled`, which leaves everything
            unchanged.
        """
        stage = self.recipe[key]
        with self._lock:
            inputs = self._inputs()
            session, results, dropped = self._session, self._results, self._dropped
            for need in stage.needs:
                key_inputs = inputs.get(need.key) if need.key in self._outcomes else None
                if key_inputs and not self._is_current(need.key, key_inputs):
                    return self._status(stage, inputs[key])
        fault = None
        try:
            results = run_stage(
                self.recipe, stage, session, results, inputs=inputs, progress=progress
            )
            stage.require(results)
        except InputError as error:
            fault = error
        with self._lock:
            # An image that was added and removed meanwhile may be in the result, but in no input.
            if self._dropped == dropped:
                self._results = results
                self._outcomes[key] = StageOutcome(inputs[key], fault)
            return self._status(stage, self._inputs()[key])

    def finish(self, recipe: Recipe | None = None) -> CalibrationRun:
        """Return the calibration.

        Parameters
        ----------
        recipe : Recipe, optional
            With some of the project's stages; by default all of them.

        Raises
        ------
        InputError
            If a stage is missing, out of date or failed.
        """
        recipe = recipe or self.recipe
        with self._lock:
            self._refresh()
            session, results = self._session, self._results
            inputs = recipe.inputs(session)
            for key, stage_inputs in inputs.items():
                if not self._is_current(key, stage_inputs):
                    text = f"The stage {key} has no up-to-date result"
                    raise InputError(text, session.folder, Remedy.COMPLETE_STAGES)
                if (fault := self.fault(key)) is not None:
                    raise fault
        refuse_copies(recipe.files(session))
        return assemble(recipe, session, results, inputs, self._tolerance_percent)

    def _inputs(self) -> dict[str, StageInputs]:
        self._refresh()
        return self.recipe.inputs(self._session)

    def _is_current(self, key: str, inputs: StageInputs) -> bool:
        outcome = self._outcomes.get(key)
        return outcome is not None and outcome.inputs == inputs

    def _status(self, stage: Stage[Any], inputs: StageInputs) -> StageStatus:
        outcome = self._outcomes.get(stage.key)
        if stage.folder and not inputs.images:
            return StageStatus(StageState.EMPTY, "No images captured yet")
        if outcome is None:
            needs = [need.key for need in stage.needs if need.used(self._session)]
            waits = any(key not in self._outcomes for key in needs)
            state = StageState.EMPTY if waits and not stage.folder else StageState.WAITING
            text = "Waiting for an earlier stage" if waits else "Not computed yet"
            return StageStatus(state, text)
        if outcome.inputs != inputs:
            changes = inputs.changes_since(outcome.inputs)
            return StageStatus(StageState.STALE, f"Out of date: {changes}")
        if outcome.fault is not None:
            return StageStatus(StageState.FAIL, str(outcome.fault))
        return judged_by(self._results[stage].quality)
