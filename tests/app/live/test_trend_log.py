"""What the live image shows of the untouched membrane reaches the sensor's folder."""

from datetime import UTC, datetime, timedelta

import numpy as np
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.context.context import AppContext
from app.live.trend_log import TrendLog
from gelpolight_core.lab.trend import FILE, keep_sample, read_samples, sample_of_frames
from gelpolight_core.light.finding import StateChange


def change(red: float) -> StateChange:
    return StateChange(np.array([red, 0.0, 0.0, 0.1, 0.0, 0.2]), np.full(6, 0.01))


def log_of(context: AppContext, qtbot: QtBot) -> TrendLog:
    owner = QWidget()
    qtbot.addWidget(owner)
    context.toasts.attach(owner, lambda: None)
    return TrendLog(owner, context=context)


def test_values_are_kept_and_a_drift_is_reported_once(context, qtbot):
    log = log_of(context, qtbot)
    folder = context.workspace.sensor_folder("S-1")
    rng = np.random.default_rng(0)
    for day in range(30, 0, -1):
        red = 0.03 * (30 - day) + rng.normal(0.0, 0.02)
        past = datetime.now(UTC) - timedelta(days=day)
        keep_sample(sample_of_frames([change(red)], "C-1", past), folder)
    for _ in range(2):
        for red in (0.89, 0.91):
            log.follow("S-1", "C-1", change(red))
        log.flush()
    *_, last = read_samples(folder)
    assert last.calibration == "C-1" and abs(last.values["light_red"][0] - 0.9) < 1e-9
    assert len(read_samples(folder)) == 32
    assert len(context.toasts.shown()) == 1


def test_another_sensor_has_its_own_file(context, qtbot):
    log = log_of(context, qtbot)
    log.follow("S-1", "C-1", change(0.0))
    log.follow("S-2", "C-2", change(1.0))
    log.flush()
    log.flush()
    kept = {s: read_samples(context.workspace.sensor_folder(s)) for s in ("S-1", "S-2")}
    assert [sample.calibration for one in kept.values() for sample in one] == ["C-1", "C-2"]
    assert not (context.workspace.folder / FILE).exists()
