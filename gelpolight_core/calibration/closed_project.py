"""The calibration of a closed sensor being made: session, results, and what is out of date."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from gelpolight_core.calibration.in_place_session import (
    InPlaceRun,
    calibrate_closed_session,
    judge_scale,
    measured_scale,
    stages_of,
    stated_grid,
)
from gelpolight_core.calibration.inputs import FOLDERS, Stage, StageInputs
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.staged_project import Outcome, StagedProject
from gelpolight_core.calibration.status import StageState, StageStatus, judged_by
from gelpolight_core.errors import InputError
from gelpolight_core.factors.bare_membrane import check_bare_membrane
from gelpolight_core.finding import QualityTable
from gelpolight_core.in_place.scale import MeasuredScale
from gelpolight_core.session.images import require_colour
from gelpolight_core.session.session import InPlace, Session, read_session
from gelpolight_core.translation import tr


@dataclass(frozen=True, slots=True)
class ClosedResults:
    """Results of a closed sensor so far.

    Attributes
    ----------
    background : QualityTable
        Figures of the untouched membrane.
    scale : MeasuredScale or None
        The newest scale from images of a pressed object, even if out of date.
    run : InPlaceRun or None
        The newest calibration, even if out of date.
    """

    background: QualityTable = field(default_factory=QualityTable)
    scale: MeasuredScale | None = None
    run: InPlaceRun | None = None


class ClosedProject(StagedProject[ClosedResults]):
    """The session folder of a closed sensor with its results; used as a CalibrationProject.

    Parameters
    ----------
    folder : Path
        A session folder whose ``session.toml`` has a table ``[in_place]``.

    Raises
    ------
    InputError
        If the folder is not such a session.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, _read, ClosedResults())

    @property
    def all_inputs(self) -> str:
        """A text that changes with any input of the calibration."""
        with self._lock:
            balls, serial = self._inputs()[Stage.BALLS], self._session.serial
        return hashlib.sha256(repr((balls.fingerprint, serial)).encode()).hexdigest()

    def statuses(self) -> dict[Stage, StageStatus]:
        """Return the present status of every stage."""
        with self._lock:
            inputs = self._inputs()
            return {stage: self._status(stage, inputs[stage]) for stage in inputs}

    def stale(self, *, upto: Stage | None = None) -> tuple[Stage, ...]:
        """Return the stages that can and need to be computed, in order.

        Parameters
        ----------
        upto : Stage, optional
            The last of them.
        """
        with self._lock:
            inputs = self._inputs()
        found = []
        for stage in inputs:
            if not inputs[stage].images:
                break
            if not self._is_current(stage, inputs[stage]):
                found.append(stage)
            elif self.fault(stage) is not None:
                break
            if stage is upto:
                break
        return tuple(found)

    def compute(self, stage: Stage, progress: Callable[[float], None] | None = None) -> StageStatus:
        """Run one stage on the present images and decisions, and store its result.

        Parameters
        ----------
        stage : Stage
            Background, scale or balls.
        progress : callable, optional
            Called with the share done; it may raise, which leaves everything unchanged.
        """
        with self._lock:
            session, results, dropped = self._session, self._results, self._dropped
            inputs = self._inputs()[stage]
        fault = None
        say = progress or (lambda _share: None)
        try:
            if stage is Stage.BACKGROUND:
                image = session.averaged("background")
                grid = stated_grid(session.in_place or InPlace(), image.size)
                image = replace(image, rgb=grid.cut(image.rgb))
                require_colour(image, where=str(session.folder / "background"))
                table = check_bare_membrane(image.rgb).quality
                results = replace(results, background=table)
            elif stage is Stage.SCALE:
                image, stated = session.averaged("background"), session.in_place or InPlace()
                results = replace(results, scale=measured_scale(session, stated, image))
            else:
                run = calibrate_closed_session(session, progress=lambda _stage, share: say(share))
                results = replace(results, run=run)
        except InputError as error:
            fault = error
        with self._lock:
            self._store(stage, Outcome(inputs, fault), results, dropped)
            return self._status(stage, self._inputs()[stage])

    def finish(self) -> InPlaceRun:
        """Return the calibration of the present images.

        Raises
        ------
        InputError
            If it is missing, out of date or failed.
        """
        with self._lock:
            status, run = self.statuses()[Stage.BALLS], self._results.run
            fault = self.fault(Stage.BALLS)
            if fault is not None:
                raise fault
            if run is None or status.state in (StageState.STALE, StageState.WAITING):
                raise self._no_result(Stage.BALLS)
            provenance = replace(run.calibration.provenance, inputs=self.all_inputs)
        return replace(run, calibration=replace(run.calibration, provenance=provenance))

    def _inputs(self) -> dict[Stage, StageInputs]:
        session = self._session
        radii = sorted(session.ball_radii_mm.items()), session.ball_default_radius_mm
        circles = sorted(session.decisions.balls.items())
        stated = session.in_place or InPlace()
        scale = stated.stated_scale, stated.mm_per_px_sd, stated.pressed_scale
        cut = () if stated.region_px is None else (stated.region_px,)
        response = session.declared_response
        background = self._inputs_of(("background",), (response, *cut) if cut else response, ())
        folders = ("balls", *stages_of(session)[2:])
        balls = self._inputs_of(folders, (radii, circles, scale, *cut), (background.fingerprint,))
        found = {Stage.BACKGROUND: background}
        if stated.mm_per_px is None:
            size = (stated.pressed_scale, *cut)
            found[Stage.SCALE] = self._inputs_of(("scale",), size, (background.fingerprint,))
        return {**found, Stage.BALLS: balls}

    def _inputs_of(
        self, folders: tuple[str, ...], stated: object, earlier: tuple[str, ...]
    ) -> StageInputs:
        files = [path for folder in folders for path in self._session.found(folder)]
        images = tuple((path.name, self._hashes(path)) for path in files)
        return StageInputs(images, repr(stated), earlier)

    def _status(self, stage: Stage, inputs: StageInputs) -> StageStatus:
        nothing = QualityTable()
        if not self._session.found(FOLDERS[stage]):
            return StageStatus(stage, StageState.EMPTY, tr("No images captured yet"), nothing)
        if stage not in self._outcomes:
            return StageStatus(stage, StageState.WAITING, tr("Not computed yet"), nothing)
        if (unfinished := self._unfinished(stage, inputs)) is not None:
            return unfinished
        table, scale, run = self._results.background, self._results.scale, self._results.run
        if stage is Stage.SCALE and scale is not None:
            more = tr("Add images of the pressed object, at other places")
            table = judge_scale(scale.mm_per_px, scale.sd_mm_per_px / scale.mm_per_px, more)
        if stage is Stage.BALLS and run is not None:
            tables = run.calibration.quality.values()
            table = QualityTable(tuple(figure for t in tables for figure in t.figures))
        return judged_by(stage, table)


def open_project(folder: Path) -> CalibrationProject | ClosedProject:
    """Open a session folder, of an open or of a closed sensor.

    Raises
    ------
    InputError
        As :func:`~gelpolight_core.session.session.read_session`.
    """
    if read_session(folder).in_place is not None:
        return ClosedProject(folder)
    return CalibrationProject(folder)


def _read(folder: Path) -> Session:
    session = read_session(folder)
    if session.in_place is not None:
        return session
    raise InputError(
        tr("The session has no table [in_place]"),
        where=str(folder),
        advice=tr("Open it as the session of an open sensor"),
    )
