"""How things stand on a live page: what the advice is given on."""

from __future__ import annotations

from app.inspect.advice import Known, Situation, Size
from app.inspect.calibration_choice import CalibrationChoice
from app.inspect.link import LiveLink
from app.shell.context import AppContext
from gelpolight_core.reconstruction.reconstructor import Reconstructor


def situation_of(
    link: LiveLink,
    calibrations: CalibrationChoice,
    loaded: Reconstructor | None,
    *,
    context: AppContext,
    size: Size | None,
    trouble: str,
    drift: str = "",
) -> Situation:
    """Return how things stand.

    Parameters
    ----------
    link : LiveLink
        With the source's stream.
    calibrations : CalibrationChoice
        All calibrations.
    loaded : Reconstructor or None
        Of the calibration in use.
    context : AppContext
        With the choice of the source.
    size, trouble, drift
        As in :class:`Situation`.
    """
    info, used = context.source.info, None
    if loaded is not None:
        camera = loaded.calibration.camera
        used = Known(loaded.calibration.sensor.serial, (camera.width, camera.height))
    summaries = (entry.summary for entry in calibrations.entries)
    return Situation(
        kind="" if info is None else info.kind,
        serial=link.serial,
        size=size,
        used=used,
        calibrations=tuple(Known(s.serial, s.picture_size) for s in summaries if s is not None),
        trouble=trouble,
        drift=drift,
        reading=calibrations.is_reading,
    )
