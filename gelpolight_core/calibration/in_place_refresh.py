"""A closed sensor whose gel was changed: its calibration with a new background, and new presses.

A new background alone keeps the slopes by change of colour: another gel of the same make differs
little (2.35 instead of 2.2 degrees on a GelSight Mini by prototypes outside this program). A few
new presses correct the differences; where they give no information, the old slopes remain.
"""

from __future__ import annotations

from dataclasses import replace

from gelpolight_core.calibration.in_place_session import InPlaceRun, calibrate_closed_session
from gelpolight_core.channels import CHANNEL_KEYS
from gelpolight_core.image.linear import LinearImage, require_size
from gelpolight_core.quality import QualityTable, judge
from gelpolight_core.reconstruction.in_place.calibration import InPlaceCalibration
from gelpolight_core.sensor_calibration import HandEdit
from gelpolight_core.session.closed import ClosedSession
from gelpolight_core.translation import tr


def with_background(
    calibration: InPlaceCalibration, background: LinearImage, *, operator: str, made: str
) -> InPlaceCalibration:
    """Return the calibration with another gel's background; slopes stay as they are.

    Its quality warns that no press of the new gel has been seen.

    Parameters
    ----------
    calibration : InPlaceCalibration
        Of the sensor with the gel before.
    background : LinearImage
        The new gel, untouched.
    operator, made : str
        Who did it and when, ISO 8601.

    Raises
    ------
    InputError
        If the image has another size.
    """
    camera = calibration.camera
    require_size(background.size, (camera.width, camera.height), where=background.name)
    model = calibration.in_place
    changed = replace(model, background=model.grid.reduce(background.rgb))
    edit = HandEdit("background", CHANNEL_KEYS, made, operator)
    provenance = replace(calibration.provenance, edits=(*calibration.provenance.edits, edit))
    unseen = judge(
        "presses_of_this_gel",
        tr("Presses of the present gel"),
        0.0,
        warn=1.0,
        higher_is_better=True,
        advice=tr("Press a ball at three or more places and repair the calibration with them"),
    )
    quality = {**calibration.quality, "gel": QualityTable((unseen,))}
    return replace(calibration, in_place=changed, quality=quality, provenance=provenance)


def repaired(calibration: InPlaceCalibration, session: ClosedSession) -> InPlaceRun:
    """Return a calibration from the presses of a session, regularised towards an earlier one.

    Parameters
    ----------
    calibration : InPlaceCalibration
        Of the sensor with the gel before.
    session : ClosedSession
        Background and presses of the present gel, three or more.

    Raises
    ------
    InputError
        As :func:`~gelpolight_core.calibration.in_place_session.calibrate_closed_session`.
    """
    return calibrate_closed_session(session, towards=calibration.in_place.coefficients)
