"""The evaluation protocol on the virtual sensor, from the first press to the evaluation."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Sequence
from contextlib import closing
from itertools import zip_longest
from pathlib import Path

from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.calibration.pipeline import calibrate_session
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.experiments.press_workers import Equipment, PressTask, work_through
from gelpolight_core.io.atomic import make_folder
from gelpolight_core.measurement.evaluation import Evaluation
from gelpolight_core.measurement.evaluation_run import evaluate_presses
from gelpolight_core.measurement.ledger import Ledger
from gelpolight_core.measurement.presses import open_ledger, press_measurement
from gelpolight_core.measurement.protocol import PressWanted
from gelpolight_core.measurement.protocol_run import ProtocolRun
from gelpolight_core.measurement.truth import read_truth
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.session import read_session
from gelpolight_core.simulation.session import simulate_session
from gelpolight_core.translation import tr

Progress = Callable[[str, float], None]

SESSION, CALIBRATION = "session", "sensor.gplcal"
LEDGER = "measurements.jsonl"


def calibrate_virtual_sensor(
    design: SensorDesign, folder: Path, *, model: str = "full", progress: Progress | None = None
) -> Path:
    """Calibrate the virtual sensor as a technician would; return the calibration's file.

    Finished results of an earlier call are used again.

    Parameters
    ----------
    design : SensorDesign
        The sensor.
    folder : Path
        Gets the folder ``session`` and the file ``sensor.gplcal``.
    model : str, optional
        Of the calibration.
    progress : callable, optional
        Called with a name and the share done, 0..1.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """

    def part(start: float, width: float) -> Progress:
        def report(name: str, share: float) -> None:
            if progress is not None:
                progress(name, start + width * share)

        return report

    made, session = folder / CALIBRATION, folder / SESSION
    if made.is_file():
        return made
    make_folder(folder)
    if not session.is_dir():
        begun = folder / f"{SESSION}.part"
        shutil.rmtree(begun, ignore_errors=True)
        simulate_session(design, begun, progress=part(0.0, 0.5))
        os.replace(begun, session)
    run = calibrate_session(read_session(session), model=model, progress=part(0.5, 0.5))
    write_calibration(run.calibration, made)
    return made


def press_protocol(
    run: ProtocolRun,
    equipment: Equipment,
    ledger: Ledger,
    *,
    workers: int = 2,
    progress: Progress | None = None,
) -> None:
    """Make all remaining presses, and measure all presses without a measurement.

    The objects alternate, so that an interrupted run contains all objects.

    Parameters
    ----------
    run : ProtocolRun
        The presses, and their folder.
    equipment : Equipment
        The virtual sensor, where presses are left, and the calibration.
    ledger : Ledger
        Keeps what is measured.
    workers : int, optional
        Number of presses processed at the same time.
    progress : callable, optional
        Called with the last task and the share done, 0..1. Its exceptions stop the work; finished
        presses are kept.

    Raises
    ------
    InputError
        If a file cannot be written, or the calibration cannot be read.
    """
    tasks = [_task(run, press, make=False) for press in run.done]
    tasks = [task for task in tasks if not _is_measured(task, ledger)]
    tasks += [_task(run, press, make=True) for press in _interleaved(run.left)]
    total = len(run.wanted)
    measured = total - len(tasks)
    with closing(work_through(tasks, equipment, workers=workers)) as results:
        for task, outcome in results:
            if task.press is not None:
                run.record(task.press)
            key = ledger.key(task.image, task.shape)
            if key is not None:
                ledger.keep(key, outcome)
            measured += 1
            if progress is not None:
                progress(tr("press {n} of {all}").format(n=measured, all=total), measured / total)


def measure_folder(
    presses: Path,
    equipment: Equipment,
    ledger: Ledger,
    *,
    workers: int = 2,
    progress: Progress | None = None,
) -> None:
    """Measure the images of a folder with ``truth.csv``, several at a time, into a ledger.

    Parameters
    ----------
    presses : Path
        The folder.
    equipment : Equipment
        The calibration.
    ledger : Ledger
        Keeps what is measured.
    workers : int, optional
        Number of images processed at the same time.
    progress : callable, optional
        Called with the file name and the share done, 0..1.

    Raises
    ------
    InputError
        If ``truth.csv`` or the calibration cannot be read, or the ledger cannot be written.
    """
    rows = read_truth(presses).rows
    tasks = [PressTask(presses / row.file, row.truth.shape) for row in rows]
    tasks = [task for task in tasks if task.image.is_file() and not _is_measured(task, ledger)]
    with closing(work_through(tasks, equipment, workers=workers)) as results:
        for number, (task, outcome) in enumerate(results, start=1):
            key = ledger.key(task.image, task.shape)
            if key is not None:
                ledger.keep(key, outcome)
            if progress is not None:
                progress(task.image.name, number / len(tasks))


def evaluate_run(run: ProtocolRun, reconstructor: Reconstructor, ledger: Ledger) -> Evaluation:
    """Evaluate the presses so far; presses in the ledger are not measured again.

    Parameters
    ----------
    run : ProtocolRun
        With at least one press.
    reconstructor : Reconstructor
        With the calibration.
    ledger : Ledger
        Of measurements with it.

    Raises
    ------
    InputError
        If nothing is pressed yet.
    """
    return evaluate_presses(
        run.presses,
        press_measurement(reconstructor),
        crossing=run.protocol.crossing,
        ledger=ledger,
    )


def run_ledger(run: ProtocolRun, reconstructor: Reconstructor) -> Ledger:
    """Return the ledger in a run's folder."""
    return open_ledger(run.folder / LEDGER, reconstructor)


def _task(run: ProtocolRun, press: PressWanted, *, make: bool) -> PressTask:
    return PressTask(run.image(press), press.truth.shape, press if make else None)


def _is_measured(task: PressTask, ledger: Ledger) -> bool:
    key = ledger.key(task.image, task.shape)
    return key is not None and ledger.find(key) is not None


def _interleaved(presses: Sequence[PressWanted]) -> list[PressWanted]:
    objects: dict[object, list[PressWanted]] = {}
    for press in presses:
        objects.setdefault(press.truth, []).append(press)
    rounds = zip_longest(*objects.values())
    return [press for of_each in rounds for press in of_each if press is not None]
