"""The calibration behind the pages: captures, corrections with undo, and the work that runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QUndoStack

from app.calibrate.commands import Correction
from app.calibrate.steps import Step
from app.calibrate.watching import Watching
from app.shell.jobs import Job, Jobs
from gelpolight_core.calibration.inputs import FOLDERS, Stage
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.status import StageStatus
from gelpolight_core.lights.mirror import spot_near
from gelpolight_core.optics.lens_views import LensView, look_for_board
from gelpolight_core.session.decisions import PlacedCircle, Point
from gelpolight_core.session.session import Session
from gelpolight_core.translation import tr


class CalibrationController(QObject):
    """What the pages of one calibration share; no widget of its own.

    What is captured is written by a thread of its own, so that it never waits for a computation.

    Attributes
    ----------
    watching : Watching
        The camera.
    undo : QUndoStack
        Every capture and correction by hand, in one history.
    jobs, desk : Jobs
        The computations, and the short work beside them.

    Signals
    -------
    changed()
        Captures, decisions or results changed.
    captured(str, str)
        Stage and name of a new picture.
    photographed(str)
        Stage of a new picture that the camera took; of an imported one it is not told.
    progressed(str, float)
        Title of the computation that runs (empty: none) and its share done.
    refused(str)
        A sentence for the person.
    """

    changed = Signal()
    captured = Signal(str, str)
    photographed = Signal(str)
    progressed = Signal(str, float)
    refused = Signal(str)

    def __init__(self, project: CalibrationProject, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.project = project
        self.undo = QUndoStack(self)
        self.watching = Watching(self)
        self.watching.refused.connect(self.refused)
        self.jobs, self.desk = Jobs("computing", self), Jobs("desk", self)
        self.jobs.progressed.connect(self.progressed)
        for jobs in (self.jobs, self.desk):
            jobs.refused.connect(self.refused)
        self._running: Stage | None = None
        self._views: dict[str, LensView] = {}

    @property
    def busy(self) -> bool:
        """Whether anything is captured, saved, looked at or computed."""
        return self.watching.capturing or self.desk.busy or self.jobs.busy

    @property
    def busy_with_pictures(self) -> bool:
        """Whether a picture is being captured or saved."""
        return self.watching.capturing or self.desk.busy

    # Pictures

    def capture(self, step: Step, *, radius_mm: float | None = None) -> None:
        """Take a picture for a step's stage, averaged over its frames; of a ball, state its radius.

        It is on disk when :attr:`captured` is told.
        """
        stage = step.stage
        assert stage is not None

        def keep(frames: list[Any]) -> None:
            def work(_tell: Callable[[float], None]) -> tuple[str, ...]:
                return (self.project.add_capture(stage, frames, radius_mm=radius_mm),)

            taken = partial(self._taken, stage, by_camera=True)
            self.desk.submit(Job(tr("Saving the picture"), work, taken, must=True))

        self.watching.capture(step.frames, keep)

    def import_files(
        self, stage: Stage, files: Sequence[Path], *, radius_mm: float | None = None
    ) -> None:
        """Copy picture files into a stage; all, or none where one does not fit."""

        def work(_tell: Callable[[float], None]) -> tuple[str, ...]:
            return self.project.import_files(stage, files, radius_mm=radius_mm)

        taken = partial(self._taken, stage)
        self.desk.submit(Job(tr("Importing pictures"), work, taken, must=True))

    def _taken(self, stage: Stage, names: tuple[str, ...], *, by_camera: bool = False) -> None:
        text = tr("Import {n} pictures").format(n=len(names))
        if len(names) == 1:
            text = tr("Take {name}").format(name=names[0])
        take_again = partial(self.project.take_again, stage, names)
        take_back = partial(self.project.take_back, stage, names)
        self.undo.push(self._command(text, take_again, take_back, stage, is_done=True))
        self.changed.emit()
        for name in names:
            self.captured.emit(stage.value, name)
        if by_camera:
            self.photographed.emit(stage.value)
        if stage is Stage.LENS:
            self.look_for_boards()
        self.compute(stage)

    def analyse(self, look: Callable[[], Any], done: Callable[[Any], None]) -> None:
        """Look at a capture beside the other work, and hand what was found to `done`."""
        self.desk.submit(Job(tr("Looking at the picture"), lambda _tell: look(), done))

    # Corrections by hand

    def exclude(self, stage: Stage, name: str, excluded: bool) -> None:
        """Leave a picture out, or take it in again; can be undone."""
        text = tr("Leave out {name}") if excluded else tr("Take in {name}")
        act = partial(self.project.exclude, stage, name)
        self.correct(text.format(name=name), partial(act, excluded), partial(act, not excluded),
                     stage)  # fmt: skip

    def place_spot(self, led: int, place: Point | None) -> None:
        """Place an LED's mirror spot by hand; can be undone."""
        act = partial(self.project.place_spot, led)
        before = self.project.session.decisions.spots_px.get(led)
        self.correct(
            tr("Place the mirror spot"), partial(act, place), partial(act, before), Stage.LIGHTS
        )

    def place_spot_near(self, led: int, place: Point, path: Path) -> None:
        """Place an LED's mirror spot on the one that a person points at, or where none is."""

        def done(near: Point | None) -> None:
            self.place_spot(led, near or place)

        self.analyse(lambda: spot_near(self.project.session.picture(path), place), done)

    def place_ball(self, name: str, circle: PlacedCircle | None) -> None:
        """Place the contact in a ball's picture by hand; can be undone."""
        act = partial(self.project.place_ball, name)
        before = self.project.session.decisions.balls.get(name)
        text = tr("Place the contact in {name}").format(name=name)
        self.correct(text, partial(act, circle), partial(act, before), Stage.BALLS)

    def set_ball_radius(self, name: str, radius_mm: float) -> None:
        """State the radius of the ball in one picture; can be undone."""
        act = partial(self.project.set_ball_radius, name)
        before = self.project.session.ball_radii_mm.get(name)
        if radius_mm != before:
            text = tr("Radius of {name}: {r:g} mm").format(name=name, r=radius_mm)
            self.correct(text, partial(act, radius_mm), partial(act, before), Stage.BALLS)

    def describe(self, session: Session) -> None:
        """Take a new description of the sensor, its boards and its balls; can be undone."""
        before = self.project.session
        self.correct(
            tr("Set-up"),
            partial(self.project.describe, session),
            partial(self.project.describe, before),
            None,
        )

    def correct(
        self,
        text: str,
        act: Callable[[], None],
        take_back: Callable[[], None],
        stage: Stage | None,
    ) -> None:
        """Do what can be undone, and compute the stage that it is about.

        Parameters
        ----------
        text : str
            What the history says.
        act, take_back : callable
            On disk before they return, or an InputError.
        stage : Stage or None
            What to compute afterwards, with what it rests on; None: everything.
        """
        self.undo.push(self._command(text, act, take_back, stage))

    def _command(
        self,
        text: str,
        act: Callable[[], None],
        take_back: Callable[[], None],
        stage: Stage | None,
        *,
        is_done: bool = False,
    ) -> Correction:
        def done() -> None:
            self.changed.emit()
            self.compute(stage)

        refused = self.refused.emit
        return Correction(text, act, take_back, done=done, refused=refused, is_done=is_done)

    def reload(self) -> None:
        """Read what is stated and decided anew; the history begins anew with it.

        Raises
        ------
        InputError
            If it cannot be used; then all stays as it was.
        """
        self.project.reload()
        self.undo.clear()
        self.changed.emit()
        self.compute()

    # Lens views

    def lens_views(self) -> dict[str, LensView]:
        """Return what was found in each lens view that was looked at, by its picture's name."""
        lens = self.project.results.lens
        known = {} if lens is None else {view.name: view for view in lens.views}
        return {**self._views, **known}

    def look_for_boards(self) -> None:
        """Look at the lens views that nobody has looked at, before there are enough for a lens."""

        def work(_tell: Callable[[float], None]) -> None:
            session, known = self.project.session, self.lens_views()
            for path in session.found(FOLDERS[Stage.LENS]):
                if path.name not in known:
                    view = look_for_board(session.picture(path), session.checkerboard)
                    self._views = {**self._views, path.name: view}

        self.desk.submit(Job(tr("Looking at the views"), work, lambda _: self.changed.emit()))

    # Work

    def statuses(self) -> dict[Stage, StageStatus]:
        """Return how every stage stands."""
        return self.project.statuses()

    @property
    def running(self) -> Stage | None:
        """The stage that is being computed."""
        return self._running

    def compute(self, upto: Stage | None = None) -> None:
        """Compute what is stale, up to a stage or all of it."""

        def work(tell: Callable[[float], None]) -> None:
            while stale := self.project.stale(upto=upto):
                tell(0.0)
                self._running = stale[0]
                try:
                    self.project.compute(stale[0], tell)
                finally:
                    self._running = None

        if self.project.stale(upto=upto):
            self.jobs.submit(Job(tr("Computing"), work, lambda _nothing: self.changed.emit()))
            self.changed.emit()

    def close(self) -> None:
        """End all work and let the camera go; what was captured is written first."""
        self.watching.set_stream(None)
        self.desk.close()
        self.jobs.close()
        self.undo.clear()
