"""Parts that the commands share that read a session folder."""

from __future__ import annotations

from pathlib import Path

from gelpolight_core.calibration.recipes import recipe_of
from gelpolight_core.session.decisions import FILE_NAME as DECISIONS
from gelpolight_core.session.description import FILE_NAME as DESCRIPTION
from gelpolight_core.session.session import Session


def session_files(session: Session) -> tuple[Path, ...]:
    """Return the files that no result may overwrite: all images, settings and decisions."""
    folders = recipe_of(session).folders(session)
    images = (path for folder in folders for path in session.captured(folder))
    return (session.folder / DESCRIPTION, session.folder / DECISIONS, *images)
