"""Make and measure presses on the virtual sensor in several processes.

Each worker is a separate process with one thread: two threads cannot use the compiled loops at the
same time, and two frames in parallel use two cores better than one frame.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cached_property
from multiprocessing.connection import wait
from pathlib import Path

import numpy as np

from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.measurement.evaluation_run import measure_press
from gelpolight_core.measurement.presses import press_measurement
from gelpolight_core.measurement.protocol import PressWanted
from gelpolight_core.measurement.result import Measurement, Truth
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.capture import write_image
from gelpolight_core.simulation.indenters import Cuboid, Cylinder, Settled
from gelpolight_core.simulation.session import pressed_membrane, settled_membrane
from gelpolight_core.simulation.virtual_sensor import VirtualSensor

HAND_MM, HAND_DEG = 0.1, 1.0
"""Repeatability of placing by hand, one standard deviation."""


@dataclass(frozen=True, slots=True)
class Equipment:
    """Data for a worker.

    Attributes
    ----------
    calibration : Path
        Its file.
    model : str or None
        ``paper`` or ``full``; None: the calibration's own.
    design : SensorDesign or None
        Design of the virtual sensor; None if no press is made.
    seed : int
        Of the virtual sensor.
    """

    calibration: Path
    model: str | None = None
    design: SensorDesign | None = None
    seed: int = 0


@dataclass(frozen=True, slots=True)
class PressTask:
    """An image to be measured, and the object to press if the image does not exist yet.

    Attributes
    ----------
    image : Path
        Path of the image, which may not exist yet.
    shape : str
        What is measured.
    press : PressWanted or None
        The object to press; None if the image exists.
    """

    image: Path
    shape: str
    press: PressWanted | None = None


class PressWorker:
    """Makes presses on the virtual sensor, and measures images.

    Parameters
    ----------
    equipment : Equipment
        Sensor and calibration.
    """

    def __init__(self, equipment: Equipment) -> None:
        self._equipment = equipment
        self._settled: dict[Cuboid, Settled] = {}

    def work(self, task: PressTask) -> Measurement | str:
        """Make the image if it does not exist, and measure it."""
        if task.press is not None:
            self.make(task.press, task.image)
        return measure_press(task.image, task.shape, self._measure_press)

    def make(self, press: PressWanted, image: Path) -> None:
        """Press an object into the virtual sensor as by hand, and write the image."""
        design = self._sensor.design
        indenter = _indenter(press.truth)
        settled = self._settled_on(indenter) if isinstance(indenter, Cuboid) else None
        x_mm, y_mm, yaw_deg = placed_by_hand(press, self._equipment.seed)
        state = pressed_membrane(
            design, indenter, x_mm=x_mm, y_mm=y_mm, yaw_deg=yaw_deg, settled=settled
        )
        write_image(self._sensor.frame(state, stream=f"protocol/{press.file}"), image)

    @cached_property
    def _sensor(self) -> VirtualSensor:
        assert self._equipment.design is not None
        return VirtualSensor(self._equipment.design, self._equipment.seed)

    @cached_property
    def _measure_press(self) -> Callable[[Path, str], Measurement]:
        calibration = read_calibration(self._equipment.calibration)
        return press_measurement(Reconstructor(calibration, model=self._equipment.model, workers=1))

    def _settled_on(self, indenter: Cuboid) -> Settled:
        if indenter not in self._settled:
            # One object is pressed many times in succession.
            if len(self._settled) > 10:
                self._settled.clear()
            self._settled[indenter] = settled_membrane(self._sensor.design, indenter)
        return self._settled[indenter]


def placed_by_hand(press: PressWanted, seed: int = 0) -> tuple[float, float, float]:
    """Return the position of a press by hand: x and y in mm, and rotation in degrees.

    Parameters
    ----------
    press : PressWanted
        The nominal position.
    seed : int, optional
        Random generator of the hand.
    """
    rng = np.random.default_rng([seed, *press.file.encode()])
    dx, dy, turn = rng.standard_normal(3) * (HAND_MM, HAND_MM, HAND_DEG)
    return press.position_mm[0] + dx, press.position_mm[1] + dy, press.yaw_deg + turn


def work_through(
    tasks: Sequence[PressTask], equipment: Equipment, *, workers: int = 2
) -> Generator[tuple[PressTask, Measurement | str], None, None]:
    """Make and measure presses, several at a time; yield each finished one.

    Parameters
    ----------
    tasks : sequence of PressTask
        In the order in which they are begun.
    equipment : Equipment
        What each worker needs.
    workers : int, optional
        Processes; with 1 the work is done in this one.

    Raises
    ------
    InputError
        If the calibration cannot be read, or an image cannot be written.
    """
    if workers == 1 or len(tasks) < 2:
        worker = PressWorker(equipment)
        for task in tasks:
            yield task, worker.work(task)
        return
    # Spawned: a forked process would inherit locks of threads that it does not have.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(
        min(workers, len(tasks)), mp_context=context, initializer=_equip, initargs=(equipment,)
    )
    try:
        jobs: dict[Future[Measurement | str], PressTask] = {
            pool.submit(_work, task): task for task in tasks
        }
        for job in as_completed(jobs):
            yield jobs[job], job.result()
    finally:
        pool.shutdown(cancel_futures=True)


_worker: PressWorker | None = None


def _equip(equipment: Equipment) -> None:
    """Prepare the process of a worker."""
    global _worker
    # Only the main process handles Ctrl-C: the present press is finished.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _worker = PressWorker(equipment)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _work(task: PressTask) -> Measurement | str:
    assert _worker is not None
    return _worker.work(task)


def _indenter(truth: Truth) -> Cylinder | Cuboid:
    if truth.shape == "cylinder":
        return Cylinder(truth.size_mm, truth.height_mm)
    return Cuboid(truth.size_mm, truth.height_mm)
