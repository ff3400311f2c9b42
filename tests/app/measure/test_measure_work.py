"""Only the page keeps the measured image in memory."""

import threading
import weakref
from dataclasses import replace
from typing import Any

import numpy as np

from app.measure.measurement_engine import (
    ImageResults,
    MeasuredImage,
    MeasurementEngine,
    MeasureRequest,
)
from app.measure.measurement_model import MeasurementModel
from app.program.display import DisplaySettings
from app.sources.latest import Done, Latest
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor.sensor_calibration import Calibration

PATIENCE_MS = 300_000


def _other_sensors(calibration: Calibration) -> Calibration:
    return calibration.changed(sensor=replace(calibration.data.sensor, serial="B-2"))


def test_an_image_is_shown_as_chosen_and_released_when_it_is_removed(
    small_calibration, small_session, qtbot
):
    image = MeasuredImage("press", next((small_session / "presses").glob("cylinder*.png")))
    work = MeasurementModel()
    work.use(Reconstructor(small_calibration))
    work.take(image)
    qtbot.waitUntil(lambda: work.image_results is not None, timeout=PATIENCE_MS)
    depth, grey = (
        work.heightmap,
        DisplaySettings(colours="CET-L1", locked=True, low_mm=0.0, high_mm=2.0),
    )
    work.show_as(grey)
    qtbot.waitUntil(lambda: work.image_results.shown.colours == "CET-L1", timeout=PATIENCE_MS)
    assert work.heightmap is depth  # it is not reconstructed again
    assert work.image_results.shown.range_mm == grey.range_mm
    height = work.image_results.shown.height[depth.known]
    assert np.ptp(height.astype(int), axis=1).max() <= 2  # grey, but for rounding
    linear = weakref.ref(work.image_results.shown.camera)
    work.take(None)
    assert not work.busy
    qtbot.waitUntil(lambda: linear() is None)
    work.take(image)
    qtbot.waitUntil(lambda: work.image_results is not None and not work.busy, timeout=PATIENCE_MS)
    work.close()


def test_results_of_an_earlier_calibration_are_not_shown(
    small_calibration, small_session, qtbot, monkeypatch
):
    first, second = small_calibration, _other_sensors(small_calibration)
    go = {calibration.serial: threading.Event() for calibration in (first, second)}
    begun, arrived = threading.Event(), list[str]()

    class Slow(MeasurementEngine):
        def __call__(self, request: MeasureRequest | None) -> ImageResults | None:
            if request is not None:
                begun.set()
                assert go[request.calibration.serial].wait(60.0)
            return super().__call__(request)

    class Watched(Latest[Any, Any]):
        def take(self) -> Done[Any, Any] | None:
            found = super().take()
            if found is not None:
                arrived.append(found.request.calibration.serial)
            return found

    monkeypatch.setattr("app.measure.measurement_model.MeasurementEngine", Slow)
    monkeypatch.setattr("app.measure.measurement_model.Latest", Watched)
    work = MeasurementModel()
    work.use(Reconstructor(first))
    work.take(MeasuredImage("press", next((small_session / "presses").glob("cylinder*.png"))))
    assert begun.wait(60.0)
    work.use(Reconstructor(second))
    go[first.serial].set()
    qtbot.waitUntil(lambda: arrived == [first.serial], timeout=PATIENCE_MS)
    assert work.heightmap is None
    go[second.serial].set()
    qtbot.waitUntil(lambda: work.heightmap is not None, timeout=PATIENCE_MS)
    assert work.heightmap.calibration_id == second.identity
    work.close()
