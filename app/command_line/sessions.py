"""Parts that the commands share that read a session folder."""

from __future__ import annotations

from pathlib import Path

from gelpolight_core.calibration.in_place_session import stages_of
from gelpolight_core.calibration.pipeline import STAGES
from gelpolight_core.session.decisions import FILE_NAME as DECISIONS
from gelpolight_core.session.description import FILE_NAME as DESCRIPTION
from gelpolight_core.session.session import Session


def session_files(session: Session) -> tuple[Path, ...]:
    """Return the files that no result may overwrite: all images, settings and decisions."""
    if session.in_place is not None:
        stages = stages_of(session)
    else:
        stages = (*session.optional_stages, *STAGES)
    images = (path for stage in stages for path in session.captured(stage))
    return (session.folder / DESCRIPTION, session.folder / DECISIONS, *images)
