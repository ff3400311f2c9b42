"""A run of the protocol: presses are saved at once and measured in the background."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from PySide6.QtCore import QObject, Signal

from app.services.jobs import Job, Jobs
from gelpolight_core import __version__
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.atomic import make_folder
from gelpolight_core.io.lock import RunLock
from gelpolight_core.measurement.characteristics import FLAT
from gelpolight_core.measurement.evaluation import Evaluation
from gelpolight_core.measurement.evaluation_run import Outcome, evaluate_presses, press_measurement
from gelpolight_core.measurement.ledger import Ledger
from gelpolight_core.measurement.press import Press
from gelpolight_core.measurement.protocol_run import ProtocolRun
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.report.evaluation import write_evaluation_files
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.images import write_image

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
            (
                "The run was started with calibration "
                f"{run.content.calibration}, but this is {made.identity}"
            ),
            run.folder,
            Remedy.START_NEW,
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

    Attributes
    ----------
    run : ProtocolRun
        The run.
    outcomes : dict of Press to Measurement or str
        What was measured, or the sentence why nothing was.
    jobs : Jobs
        Its work in the background, with progress and refusals.

    Signals
    -------
    changed()
        The next press or what was measured changed.
    """

    changed = Signal()

    def __init__(self, equipped: Equipped, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._equipped = equipped
        self.run = equipped.run
        self.outcomes: dict[Press, Outcome] = {}
        self._outcome_of = partial(
            equipped.ledger.outcome, measure=press_measurement(equipped.reconstructor)
        )
        self.jobs = Jobs("protocol", self)

    @property
    def calibration(self) -> Calibration:
        """The calibration of the run."""
        return self._equipped.reconstructor.calibration

    def catch_up(self) -> None:
        """Measure the presses that are not yet measured, or report why this is not possible."""
        for press in self.run.done:
            if press not in self.outcomes:
                self._measure(press)

    def accept(self, press: Press, frames: Sequence[NDArray[Any]]) -> bool:
        """Save a press and measure it. Return whether it was written to disk."""
        if accepted := self._change(lambda: self.run.accept(press, frames)):
            self._measure(press)
        return accepted

    def keep_flat(self, frames: Sequence[NDArray[Any]]) -> None:
        """Save images of the bare membrane, for noise and flatness of the sensor."""

        def keep() -> None:
            folder = self.run.presses / FLAT
            for number, frame in enumerate(frames, len(list(folder.glob("*.png"))) + 1):
                write_image(frame, folder / f"{number:03d}.png")

        self._change(keep)

    def refuse(self, press: Press, reason: str) -> None:
        """Count a refused press."""
        self._change(lambda: self.run.refuse(press, reason))

    def take_back(self) -> None:
        """Repeat the previous press. Its old image is kept in another folder."""
        if self.run.done:
            last = self.run.done[-1]
            self.outcomes.pop(last, None)
            self._change(lambda: self.run.take_back(last))

    def evaluate(self, done: Callable[[Evaluation], None]) -> None:
        """Compare all presses with their true values, after the running measurements."""
        reconstructor = self._equipped.reconstructor

        def work() -> Evaluation:
            return evaluate_presses(self.run.presses, self._outcome_of, reconstructor=reconstructor)

        self._do("Evaluating", work, done)

    def _do(self, title: str, work: Callable[[], Any], done: Callable[[Any], None]) -> None:
        """Work in the background."""
        self.jobs.submit(Job(title, lambda _progress: work(), done))

    def write_report(
        self,
        evaluation: Evaluation,
        folder: Path,
        done: Callable[[tuple[Path, ...]], None],
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
        """

        def write() -> tuple[Path, ...]:
            make_folder(folder)
            return write_evaluation_files(evaluation, folder, calibration=self.calibration)

        self._do("Writing the report", write, done)

    def retire(self, gone: Callable[[], object]) -> None:
        """Stop measuring after the current press. Call `gone` when no work is running any more."""
        self._equipped.lock.release()
        self.jobs.cancel()
        if not self.jobs.busy:
            gone()
            return
        self.jobs.progressed.connect(lambda title, _share: None if title else gone())

    def close(self) -> None:
        """Stop measuring and wait for the current press. Nothing runs afterwards."""
        self._equipped.lock.release()
        self.jobs.close()

    def _measure(self, press: Press) -> None:
        image = self.run.image(press)

        def done(outcome: Outcome) -> None:
            # It may have been discarded meanwhile.
            if press in self.run.done:
                self.outcomes[press] = outcome
                self.changed.emit()

        self._do("Measuring", lambda: self._outcome_of(image, press.truth), done)

    def _change(self, change: Callable[[], object]) -> bool:
        """Change the run. Return whether it was written to disk."""
        try:
            change()
        except InputError as refusal:
            self.jobs.refused.emit(str(refusal))
            return False
        finally:
            self.changed.emit()
        return True
