"""Where a calibration comes from: who made it, when, and from which files."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

from gelpolight_core import __version__
from gelpolight_core.io.reading import as_text
from gelpolight_core.io.user import user_name
from gelpolight_core.sensor_calibration import Provenance
from gelpolight_core.session.decisions import FILE_NAME as DECISIONS_FILE
from gelpolight_core.session.file_hashes import file_hash
from gelpolight_core.session.session import Session


def provenance_of(session: Session, files: Iterable[Path], *, inputs: str = "") -> Provenance:
    """Return the provenance of a calibration that is made now.

    Parameters
    ----------
    session : Session
        With its folder and camera settings.
    files : iterable of Path
        The images that were used.
    inputs : str, optional
        Hash of all inputs.
    """
    folder, camera = session.folder, session.camera_settings
    described = (folder / name for name in ("session.toml", DECISIONS_FILE))
    sources = {as_text(f"{path.parent.name}/{path.name}"): file_hash(path) for path in files}
    sources |= {path.name: file_hash(path) for path in described if path.is_file()}
    return Provenance(
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        operator=user_name(),
        program_version=__version__,
        session=as_text(folder.resolve().name),
        sources=sources,
        inputs=inputs,
        camera_settings={} if camera is None else camera.as_texts(),
    )
