"""Calibrate a session of an open or of a closed sensor."""

from __future__ import annotations

from gelpolight_core.calibration.in_place_session import InPlaceRun, calibrate_closed_session
from gelpolight_core.calibration.pipeline import CalibrationRun, Progress, calibrate_session
from gelpolight_core.errors import InputError
from gelpolight_core.reconstruction.in_place.calibration import MODEL as IN_PLACE
from gelpolight_core.sensor_calibration import MODELS
from gelpolight_core.session.session import Session
from gelpolight_core.translation import tr


def calibrate_any(
    session: Session, *, model: str | None = None, progress: Progress | None = None
) -> CalibrationRun | InPlaceRun:
    """Calibrate a sensor from its session.

    Parameters
    ----------
    session : Session
        What was captured.
    model : {"full", "paper", "in-place"}, optional
        By default ``in-place`` for a closed sensor and ``full`` for an open one.
    progress : callable, optional
        Called with the stage's name and the share done (0 to 1).

    Raises
    ------
    InputError
        If the model does not fit the session, or a stage is missing or cannot be used.
    """
    closed = session.in_place is not None
    if model is not None and closed != (model == IN_PLACE):
        raise InputError(
            tr("The session is of a closed sensor")
            if closed
            else tr("The session has no table [in_place]"),
            where=f"--model {model}",
            advice=tr("Do not choose a model: it follows from the session"),
        )
    if closed:
        return calibrate_closed_session(session, progress=progress)
    return calibrate_session(session, model=model or MODELS[-1], progress=progress)
