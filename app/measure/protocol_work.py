"""A run of the protocol: presses are saved at once and measured in the background."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from numpy.typing import NDArray
from PySide6.QtCore import QObject, Signal

from app.services.jobs import Job, Jobs
from gelpolight_core import __version__
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.atomic import make_folder
from gelpolight_core.io.lock import RunLock
from gelpolight_core.measurement.evaluation import Evaluation
from gelpolight_core.measurement.evaluation_run import Outcome, evaluate_presses, press_measurement
from gelpolight_core.measurement.ledger import Ledger
from gelpolight_core.measurement.press import Press
from gelpolight_core.measurement.protocol_run import ProtocolRun
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.report.evaluation import write_evaluation_files
from gelpolight_core.translation import tr

T = TypeVar("T")
REPORT, LEDGER = "report", "measurements.jsonl"


@dataclass(frozen=True, slots=True)
class Equipped:
    """A run with the objects needed to measure it.

    Attributes
    ----------
    run : ProtocolRun
        The run.
    reconstructor : Reconstructor
        Of its calibration.
    ledger : Ledger
        The measurements so far.
    lock : RunLock
        Prevents other programs from writing the run.
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
        If the calibration cannot be read, the run was started with another one, or another program
        writes it.
    """
    reconstructor = Reconstructor(read_calibration(calibration))
    made = reconstructor.calibration
    if run.content.calibration != made.identity:
        raise InputError(
            tr("The run was started with calibration {old}, but this is {new}").format(
                old=run.content.calibration, new=made.identity
            ),
            where=run.folder,
            advice=Remedy.START_NEW,
        )
    lock = RunLock(run.folder)
    try:
        name = f"{made.identity} {made.verdict} {reconstructor.model} {__version__}"
        ledger = Ledger(run.folder / LEDGER, name)
        return Equipped(run, reconstructor, ledger, lock)
    except BaseException:
        lock.release()
        raise


class ProtocolWork(QObject):
    """Saves and measures the presses of one run.

    Signals
    -------
    measured(object, object)
        A Press, and its Measurement or the sentence why there is none.
    changed()
        The next press or the number of measured ones changed.
    evaluated(object)
        An Evaluation of all presses so far.
    refused(str)
        A sentence: what failed.
    busy(str, float)
        Title and progress (0 to 1) of the running work. An empty title: none.
    gone()
        It was retired, and no work is running any more.
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
        self._outcome_of = partial(
            equipped.ledger.outcome, measure=press_measurement(equipped.reconstructor)
        )
        self._outcomes: dict[str, Outcome] = {}
        self._jobs = Jobs("protocol", self)
        self._jobs.progressed.connect(self.busy)
        self._jobs.refused.connect(self.refused)

    @property
    def calibration(self) -> Any:
        """The settings of the evaluation."""
        return self._equipped.reconstructor.calibration

    @property
    def measured_count(self) -> int:
        """Number of measured presses."""
        return len(self._outcomes)

    def catch_up(self) -> None:
        """Measure the presses that are not yet measured, or report why this is not possible."""
        for press in self.run.done:
            if press.file not in self._outcomes:
                self._measure(press)

    def accept(self, press: Press, frames: Sequence[NDArray[Any]]) -> bool:
        """Save a press and measure it. Return whether it was written to disk."""
        if not self._on_disk(lambda: self.run.accept(press, frames)):
            return False
        self._measure(press)
        self.changed.emit()
        return True

    def refuse(self, press: Press, reason: str) -> None:
        """Count a refused press."""
        self._on_disk(lambda: self.run.refuse(press, reason))
        self.changed.emit()

    def take_back(self) -> None:
        """Repeat the previous press. Its old image is kept in another folder."""
        done = self.run.done
        if done:
            self._on_disk(lambda: self.run.take_back(done[-1]))
            self._outcomes.pop(done[-1].file, None)
            self.changed.emit()

    def evaluate(self) -> None:
        """Compare all presses with their true values, after the running measurements."""
        self._do(
            tr("Evaluating"),
            lambda: evaluate_presses(self.run.presses, self._outcome_of),
            self.evaluated.emit,
        )

    def _do(self, title: str, work: Callable[[], T], done: Callable[[T], object]) -> None:
        """Work in the background."""
        self._jobs.submit(Job(title, lambda _progress: work(), done))

    def write_report(
        self,
        evaluation: Evaluation,
        folder: Path,
        done: Callable[[tuple[Path, ...]], None],
        *,
        limits_percent: tuple[float, float],
    ) -> None:
        """Write every file of the report into a folder, then call `done` with their paths.

        Parameters
        ----------
        evaluation : Evaluation
            Content of the report.
        folder : Path
            Created if it is missing.
        done : callable
            Called with the paths of the written files.
        limits_percent : (float, float)
            Maximum mean absolute errors, planar and in depth, for a pass.
        """

        def write() -> tuple[Path, ...]:
            make_folder(folder)
            return write_evaluation_files(
                evaluation, folder, calibration=self.calibration, limits_percent=limits_percent
            )

        self._do(tr("Writing the report"), write, done)

    def retire(self) -> None:
        """Stop measuring after the current press, and close. The run can be continued."""
        self._equipped.lock.release()
        self._jobs.cancel()
        if self._jobs.busy:
            self._jobs.progressed.connect(self._go_when_done)
        else:
            self._go_when_done("", 0.0)

    def close(self) -> None:
        """Stop measuring and wait for the current press. Nothing runs afterwards."""
        self._equipped.lock.release()
        self._jobs.close()

    def _go_when_done(self, title: str, _share: float) -> None:
        if not title:
            self._jobs.close()
            self.gone.emit()

    def _measure(self, press: Press) -> None:
        image, shape = self.run.image(press), press.truth.shape

        def done(outcome: Outcome) -> None:
            # It may have been discarded meanwhile.
            if press in self.run.done:
                self._outcomes[press.file] = outcome
                self.measured.emit(press, outcome)
                self.changed.emit()

        self._do(tr("Measuring"), lambda: self._outcome_of(image, shape), done)

    def _on_disk(self, change: Callable[[], object]) -> bool:
        """Change the run. Return whether it was written to disk."""
        try:
            change()
        except InputError as refusal:
            self.refused.emit(str(refusal))
            return False
        return True
