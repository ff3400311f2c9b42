"""A run of the protocol on screen: what is pressed is kept at once, and measured beside."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from PySide6.QtCore import QObject, Signal

from app.measure.protocol_look import PictureMap
from app.shell.jobs import Job, Jobs
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.errors import InputError
from gelpolight_core.experiments.virtual_protocol import evaluate_run, run_ledger
from gelpolight_core.export.atomic import make_folder
from gelpolight_core.export.run_lock import RunLock
from gelpolight_core.measurement.evaluation import Evaluation, measure_press
from gelpolight_core.measurement.ledger import Ledger
from gelpolight_core.measurement.presses import picture_reconstruction
from gelpolight_core.measurement.protocol import PressWanted
from gelpolight_core.measurement.protocol_run import ProtocolRun
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.report.evaluation_files import write_evaluation_files
from gelpolight_core.translation import tr

_LOG = logging.getLogger(__name__)
REPORT = "report"


@dataclass(frozen=True, slots=True)
class Equipped:
    """A run with what it is measured with.

    Attributes
    ----------
    run : ProtocolRun
        The run.
    reconstructor : Reconstructor
        Of its calibration.
    ledger : Ledger
        What is measured already.
    lock : RunLock
        Keeps other programs from writing the run.
    """

    run: ProtocolRun
    reconstructor: Reconstructor
    ledger: Ledger
    lock: RunLock


def equip(run: ProtocolRun, calibration: Path) -> Equipped:
    """Return a run with its calibration, read from its file.

    Raises
    ------
    InputError
        If the calibration cannot be read, the run was begun with another one, or another program
        writes it.
    """
    reconstructor = Reconstructor(read_calibration(calibration))
    made = reconstructor.calibration
    if run.content.calibration != made.identity:
        raise InputError(
            tr("the run was begun with calibration {old}, this is {new}").format(
                old=run.content.calibration, new=made.identity
            ),
            where=str(run.folder),
            advice=tr("Use that calibration, or begin a new run"),
        )
    lock = RunLock(run.folder)
    try:
        return Equipped(run, reconstructor, run_ledger(run, reconstructor), lock)
    except BaseException:
        lock.release()
        raise


class ProtocolWork(QObject):
    """Keeps and measures the presses of one run.

    Signals
    -------
    measured(object, object)
        A PressWanted, and its Measurement or the sentence why there is none.
    changed()
        Another press is next, or another count is measured.
    evaluated(object)
        An Evaluation of all that is pressed.
    refused(str)
        A sentence: what could not be done.
    busy(str, float)
        What runs and its share done; an empty text: nothing.
    gone()
        It was retired, and nothing runs any more.
    """

    measured = Signal(object, object)
    changed = Signal()
    evaluated = Signal(object)
    refused = Signal(str)
    busy = Signal(str, float)
    gone = Signal()

    def __init__(self, equipped: Equipped, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._equipped = equipped
        self.run = equipped.run
        self.picture = PictureMap(equipped.reconstructor.calibration)
        self._reconstruct = picture_reconstruction(equipped.reconstructor)
        self._outcomes: dict[str, Measurement | str] = {}
        self._jobs = Jobs("protocol", self)
        self._jobs.progressed.connect(self.busy)
        self._jobs.refused.connect(self.refused)

    @property
    def calibration(self) -> Any:
        """What is evaluated."""
        return self._equipped.reconstructor.calibration

    @property
    def measured_count(self) -> int:
        """How many presses are measured."""
        return len(self._outcomes)

    def catch_up(self) -> None:
        """Measure what was pressed before and is not measured, or say what is."""
        for press in self.run.done:
            if press.file not in self._outcomes:
                self._measure(press)

    def accept(self, press: PressWanted, frames: Sequence[NDArray[Any]]) -> bool:
        """Keep a press and measure it; return whether the disk took it."""
        try:
            self.run.accept(press, frames)
        except InputError as refusal:
            self.refused.emit(str(refusal))
            return False
        self._measure(press)
        self.changed.emit()
        return True

    def refuse(self, press: PressWanted, reason: str) -> None:
        """Note that a press was not kept."""
        self._on_disk(lambda: self.run.refuse(press, reason))
        self.changed.emit()

    def take_back(self) -> None:
        """Make the press before the next one again; its picture is kept apart."""
        done = self.run.done
        if done:
            self._on_disk(lambda: self.run.take_back(done[-1]))
            self._outcomes.pop(done[-1].file, None)
            self.changed.emit()

    def evaluate(self) -> None:
        """Compare all that is pressed with its truth, after what is still being measured."""
        equipped = self._equipped

        def work(tell: Callable[[float], None]) -> Evaluation:
            tell(0.0)
            return evaluate_run(equipped.run, equipped.reconstructor, equipped.ledger)

        self._jobs.submit(Job(tr("Evaluating"), work, self.evaluated.emit, self.refused.emit))

    def write_report(
        self,
        evaluation: Evaluation,
        folder: Path,
        done: Callable[[tuple[Path, ...]], None],
        *,
        limits_percent: tuple[float, float],
    ) -> None:
        """Write every file of the report into a folder, then call `done` with their places.

        Parameters
        ----------
        evaluation : Evaluation
            What is reported.
        folder : Path
            Made where it is missing.
        done : callable
            Given the places of what was written.
        limits_percent : (float, float)
            Largest mean absolute errors, planar and in depth, for it to pass.
        """

        def work(tell: Callable[[float], None]) -> tuple[Path, ...]:
            tell(0.1)
            make_folder(folder)
            return write_evaluation_files(
                evaluation, folder, calibration=self.calibration, limits_percent=limits_percent
            )

        self._jobs.submit(Job(tr("Writing the report"), work, done, self.refused.emit))

    def retire(self) -> None:
        """Stop measuring after the press at hand, and go; the run can be gone on with."""
        self._equipped.lock.release()
        self._jobs.cancel()
        if self._jobs.busy:
            self._jobs.progressed.connect(self._go_when_done)
        else:
            self._go_when_done("", 0.0)

    def close(self) -> None:
        """Stop measuring and wait for the press at hand: nothing runs afterwards."""
        self._equipped.lock.release()
        self._jobs.close()

    def _go_when_done(self, title: str, _share: float) -> None:
        if not title:
            self._jobs.close()
            self.gone.emit()

    def _measure(self, press: PressWanted) -> None:
        picture, shape, ledger = self.run.picture(press), press.truth.shape, self._equipped.ledger

        def work(tell: Callable[[float], None]) -> Measurement | str:
            tell(0.0)
            return measure_press(picture, shape, self._reconstruct, ledger)

        def done(outcome: Measurement | str) -> None:
            # It may have been taken back meanwhile.
            if press in self.run.done:
                self._outcomes[press.file] = outcome
                self.measured.emit(press, outcome)
                self.changed.emit()

        self._jobs.submit(Job(tr("Measuring"), work, done, self.refused.emit))

    def _on_disk(self, change: Callable[[], object]) -> None:
        try:
            change()
        except InputError as refusal:
            self.refused.emit(str(refusal))
