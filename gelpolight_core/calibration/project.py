"""A calibration in the making: captures, decisions and results of one session folder.

Everything captured or decided is on disk before the call that brings it returns, so that a crash
loses nothing; results are made anew from there. The project knows which results are stale. It may
be used by two threads: one that captures and decides, one that computes.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any, BinaryIO

from numpy.typing import NDArray

from gelpolight_core.calibration.calibration import MODELS
from gelpolight_core.calibration.inputs import (
    FOLDERS,
    NEEDS,
    Stage,
    StageInputs,
    changes_between,
    inputs_of,
)
from gelpolight_core.calibration.pipeline import CalibrationRun, assemble, judge_joint, stages_of
from gelpolight_core.calibration.stages import StageResults, run_stage
from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import make_folder, write_atomically
from gelpolight_core.quality import QualityTable, Verdict
from gelpolight_core.session.capture import average_frames, write_picture
from gelpolight_core.session.decisions import (
    Decisions,
    PlacedCircle,
    Point,
    write_decisions,
)
from gelpolight_core.session.description import write_description
from gelpolight_core.session.session import (
    ONE_IMAGE_STAGES,
    SensorData,
    Session,
    file_hash,
    read_picture,
    read_session,
)
from gelpolight_core.translation import tr

Frame = NDArray[Any]


class StageState(StrEnum):
    """How a stage stands."""

    EMPTY = "empty"
    WAITING = "waiting"
    STALE = "stale"
    PASS = "pass"
    WARN = "warn"
    FAIL = "fail"


@dataclass(frozen=True, slots=True)
class StageStatus:
    """How a stage stands, and why.

    Attributes
    ----------
    stage : Stage
        Which.
    state : StageState
        ``waiting``: its pictures are there, a result is not; ``stale``: there is a result, but not
        of the present pictures.
    sentence : str
        What to say to a person.
    quality : QualityTable
        The figures of the present result.
    """

    stage: Stage
    state: StageState
    sentence: str
    quality: QualityTable


class Cancelled(Exception):
    """Raised out of a computation that a person has stopped."""


@dataclass(frozen=True, slots=True)
class _Outcome:
    inputs: StageInputs
    fault: InputError | None


class CalibrationProject:
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
        self._lock = threading.RLock()
        self._hashes = _RememberedHashes()
        self._session = read_session(folder)
        self._results = StageResults()
        self._outcomes: dict[Stage, _Outcome] = {}

    @property
    def session(self) -> Session:
        """The session as it stands."""
        return self._session

    @property
    def results(self) -> StageResults:
        """The newest result of every stage, stale or not."""
        return self._results

    # What a person captures and decides -------------------------------------------------------

    def add_capture(self, stage: Stage, frames: Sequence[Frame]) -> str:
        """Keep frames of one view as one picture, their average; return its name.

        A new capture takes the place of the earlier ones where a stage has a single view; those
        are kept, excluded.

        Parameters
        ----------
        stage : Stage
            One with pictures of its own.
        frames : sequence of (rows, columns, 3) uint8 or uint16
            RGB.

        Raises
        ------
        InputError
            If it cannot be written.
        """
        folder = FOLDERS[stage]
        with self._lock:
            name = self._next_name(folder)
            write_picture(average_frames(frames), self._session.folder / folder / name)
            self._replace_views(folder, {name})
        return name

    def import_files(self, stage: Stage, files: Sequence[Path]) -> tuple[str, ...]:
        """Copy picture files into a stage; return their new names.

        Raises
        ------
        InputError
            If a file is no picture; then none is taken.
        """
        folder = FOLDERS[stage]
        for path in files:
            read_picture(path)
        names = []
        with self._lock:
            for path in files:
                name = self._next_name(folder, path.suffix.lower())
                data = path.read_bytes()
                make_folder(self._session.folder / folder)
                write_atomically(self._session.folder / folder / name, _writer(data))
                names.append(name)
            self._replace_views(folder, set(names))
        return tuple(names)

    def decide(self, decisions: Decisions) -> None:
        """Take new decisions in the place of the present ones, on disk first."""
        with self._lock:
            write_decisions(decisions, self._session.folder)
            self._session = replace(self._session, decisions=decisions)

    def exclude(self, stage: Stage, name: str, excluded: bool = True) -> None:
        """Leave a picture out, or take it in again."""
        with self._lock:
            key = f"{FOLDERS[stage]}/{name}"
            names = self._session.decisions.excluded
            names = names | {key} if excluded else names - {key}
            self.decide(replace(self._session.decisions, excluded=names))

    def place_spot(self, led: int, place: Point | None) -> None:
        """Set an LED's mirror spot by hand; None goes back to what was detected."""
        with self._lock:
            spots = _with(self._session.decisions.spots_px, led, place)
            self.decide(replace(self._session.decisions, spots_px=spots))

    def place_ball(self, name: str, circle: PlacedCircle | None) -> None:
        """Set the contact in a picture of a ball by hand; None goes back to what was detected."""
        with self._lock:
            balls = _with(self._session.decisions.balls, name, circle)
            self.decide(replace(self._session.decisions, balls=balls))

    def edit_curve(self, channel: int, nodes: tuple[Point, ...] | None) -> None:
        """Set a channel's reflectance curve by hand; None goes back to the fitted one."""
        with self._lock:
            curves = _with(self._session.decisions.curves, channel, nodes)
            self.decide(replace(self._session.decisions, curves=curves))

    def describe(self, session: Session) -> None:
        """Take a new description of sensor, boards and balls, on disk first."""
        with self._lock:
            kept = replace(session, folder=self._session.folder, decisions=self._session.decisions)
            write_description(kept)
            self._session = kept

    def set_sensor(self, sensor: SensorData) -> None:
        """Take what is stated of the sensor."""
        self.describe(replace(self._session, sensor=sensor))

    def set_ball_radius(self, name: str, radius_mm: float) -> None:
        """State the radius of the ball in one picture."""
        with self._lock:
            radii = {**self._session.ball_radii_mm, name: radius_mm}
            self.describe(replace(self._session, ball_radii_mm=radii))

    def _next_name(self, folder: str, suffix: str = ".png") -> str:
        taken = [p.stem for p in self._session.captured(folder)]
        numbers = [int(stem[-3:]) for stem in taken if stem[-3:].isdigit()]
        number = max([*numbers, len(taken)], default=0) + 1
        return f"{_STEMS[folder]}_{number:03d}{suffix}"

    def _replace_views(self, folder: str, names: set[str]) -> None:
        if folder in ONE_IMAGE_STAGES:
            former = {
                f"{folder}/{path.name}"
                for path in self._session.found(folder)
                if path.name not in names
            }
            excluded = self._session.decisions.excluded | former
            if former:
                self.decide(replace(self._session.decisions, excluded=excluded))

    # What is computed -------------------------------------------------------------------------

    def statuses(self) -> dict[Stage, StageStatus]:
        """Return how every stage stands at present."""
        with self._lock:
            inputs = inputs_of(self._session, self._hashes)
            return {stage: self._status(stage, inputs) for stage in Stage}

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
            if stage in FOLDERS and not inputs[stage].pictures:
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
        """Run one stage on the present pictures and decisions, and keep its result.

        A stage that cannot be completed keeps its fault as its status.

        Parameters
        ----------
        stage : Stage
            Which.
        tell : callable, optional
            Told the share done; it may raise :class:`Cancelled`, which leaves all as it was.
        """
        with self._lock:
            session, results = self._session, self._results
            inputs = inputs_of(session, self._hashes)
        fault = None
        try:
            results = run_stage(stage, session, results, tell=tell)
        except InputError as error:
            fault = error
        with self._lock:
            if fault is None:
                self._results = results
            self._outcomes[stage] = _Outcome(inputs[stage], fault)
            return self._status(stage, inputs_of(self._session, self._hashes))

    def finish(self, *, model: str = MODELS[-1]) -> CalibrationRun:
        """Return the calibration.

        Raises
        ------
        InputError
            If a stage is missing, stale or failed.
        """
        with self._lock:
            for stage, status in self.statuses().items():
                if stage not in stages_of(model):
                    continue
                if status.state in (StageState.EMPTY, StageState.WAITING, StageState.STALE):
                    raise InputError(
                        tr("the stage {stage} has no present result").format(stage=stage.value),
                        where=str(self._session.folder),
                        advice=tr("Complete the stages that are still open"),
                    )
                fault = self._outcomes[stage].fault
                if fault is not None:
                    raise fault
            return assemble(self._session, self._results, model=model)

    def _status(self, stage: Stage, inputs: Mapping[Stage, StageInputs]) -> StageStatus:
        outcome = self._outcomes.get(stage)
        nothing = QualityTable()
        if stage in FOLDERS and not inputs[stage].pictures:
            return StageStatus(stage, StageState.EMPTY, tr("Nothing captured yet"), nothing)
        if outcome is None:
            missing = [need for need in NEEDS[stage] if need not in self._outcomes]
            said = tr("Not computed yet")
            if missing:
                said = tr("Waits for an earlier stage")
            empty = stage not in FOLDERS and missing
            state = StageState.EMPTY if empty else StageState.WAITING
            return StageStatus(stage, state, said, nothing)
        if outcome.inputs != inputs[stage]:
            said = tr("Stale: {changes}").format(
                changes="; ".join(changes_between(outcome.inputs, inputs[stage]))
            )
            return StageStatus(stage, StageState.STALE, said, nothing)
        if outcome.fault is not None:
            return StageStatus(stage, StageState.FAIL, str(outcome.fault), nothing)
        return self._judged(stage)

    def _judged(self, stage: Stage) -> StageStatus:
        if stage is Stage.BALLS:
            for ball in self._results.balls:
                if ball.fault is not None:
                    return StageStatus(stage, StageState.FAIL, str(ball.fault), QualityTable())
        table = quality_of(stage, self._results)
        state = {
            Verdict.PASS: StageState.PASS,
            Verdict.WARN: StageState.WARN,
            Verdict.FAIL: StageState.FAIL,
        }[table.verdict]
        said = (
            ". ".join(table.advice) + "."
            if table.advice
            else tr("Everything is within its limits.")
        )
        return StageStatus(stage, state, said, table)


def quality_of(stage: Stage, results: StageResults) -> QualityTable:
    """Return the quality table of a stage's result; an empty one where there is none."""
    figures: list[Any] = []
    parts: tuple[Any, ...] = {
        Stage.LENS: (results.lens,),
        Stage.TOP_POSE: (results.top_pose,),
        Stage.LIGHTS: (results.lights,),
        Stage.RADIANCE: (results.radiance,),
        Stage.BACKGROUND: (),
        Stage.BALLS: (),
        Stage.REFLECTANCE: (results.reflectance, results.factors),
        Stage.JOINT: (),
    }[stage]
    for part in parts:
        if part is not None:
            figures += part.quality.figures
    if stage is Stage.JOINT and results.full is not None:
        figures += judge_joint(results.full).figures
    if stage is Stage.BALLS:
        figures += worst_figures([press.quality for press in results.presses])
    return QualityTable(tuple(figures))


def worst_figures(tables: Sequence[QualityTable]) -> list[Any]:
    """Return each figure of several tables where it is judged worst, in the tables' order."""
    order = list(Verdict)
    worst: dict[str, Any] = {}
    for table in tables:
        for figure in table.figures:
            known = worst.get(figure.key)
            if known is None or order.index(figure.verdict) > order.index(known.verdict):
                worst[figure.key] = figure
    return list(worst.values())


_STEMS = {
    "checkerboard": "view",
    "top_pose": "top",
    "mirror": "mirror",
    "whiteboard": "whiteboard",
    "background": "background",
    "balls": "ball",
}


def _writer(data: bytes) -> Callable[[BinaryIO], object]:
    return lambda stream: stream.write(data)


def _with(mapping: Mapping[Any, Any], key: Any, value: Any) -> dict[Any, Any]:
    changed = {k: v for k, v in mapping.items() if k != key}
    if value is not None:
        changed[key] = value
    return changed


def _closure(stage: Stage) -> set[Stage]:
    found = {stage}
    for need in NEEDS[stage]:
        found |= _closure(need)
    return found


class _RememberedHashes:
    """Hashes of files, made anew only when a file's size or time has changed."""

    def __init__(self) -> None:
        self._known: dict[Path, tuple[tuple[int, int], str]] = {}

    def __call__(self, path: Path) -> str:
        stat = path.stat()
        mark = stat.st_size, stat.st_mtime_ns
        known = self._known.get(path)
        if known is None or known[0] != mark:
            known = self._known[path] = mark, file_hash(path)
        return known[1]
