"""Write every kind of file on a disk that is full, then can only be read: ``disk_trial.py FOLDER``.

The folder is a small disk of its own, in a process that may mount it anew. Prints as JSON what was
reported for each kind: a sentence, nothing where it was written after all, or what should not be.
"""

from __future__ import annotations

import gc
import json
import logging
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from recorded import noisy
from test_every_file_written import tree
from written import DRAWN, KINDS, RECORD, Written

from app.services.log import Log
from app.services.settings import Settings
from app.workspace.workspace import Workspace
from gelpolight_core.errors import InputError
from gelpolight_core.io.lock import RunLock
from gelpolight_core.recording.reader import Recording
from gelpolight_core.recording.recording import RecordingHeader
from gelpolight_core.recording.writer import RecordingWriter
from gelpolight_core.records.records import NAME, Records


def fill(folder: Path) -> Path:
    """Leave no byte free."""
    filler = folder / "filler"
    with filler.open("wb", buffering=0) as file:
        try:
            while file.write(bytes(4096)) == 4096:
                pass
        except OSError:
            os.fsync(file.fileno())
    return filler


def tried(act: Callable[[], object]) -> str:
    """Return the sentence of a refusal; what else is raised is returned as what it is."""
    try:
        act()
    except InputError as error:
        return f"refused: {error}"
    except BaseException as error:
        return f"FAULT: {type(error).__name__}: {error}"
    return "written"


def file_kind(kind: Written, folder: Path) -> str:
    """Try one of the kinds that are written whole; the older file has to stay as it was."""
    before = tree(folder)
    output = tried(lambda: kind.write(folder, 1))
    if output.startswith("refused") and tree(folder) != before:
        return f"FAULT: the older file is not whole after {output}"
    return output


def record(folder: Path) -> str:
    """Try to keep a measurement; those before have to stay."""

    def add() -> None:
        with Records.open(folder / NAME) as records:
            for _ in range(50):
                records.add(RECORD)

    output = tried(add)
    with Records.open(folder / NAME) as records:
        if len(records.measurements()) < 3:
            return f"FAULT: measurements are lost after {output}"
    return output


def recording(folder: Path) -> str:
    """Try to go on with a recording; the frames before have to stay."""
    with RecordingWriter(folder / "new.gplrec", RecordingHeader()) as writer:
        for number in range(100):
            writer.append(noisy(number), number, float(number))
    return "written"


def go_on_recording(folder: Path) -> str:
    """As :func:`recording`, and read what there is."""
    output = tried(lambda: recording(folder))
    with Recording.open(folder / "old.gplrec") as old:
        if len(old) != 2:
            return f"FAULT: frames are lost after {output}"
    return output


def settings(folder: Path) -> str:
    """Remember something; nothing can be done where that fails, and nothing else may be lost."""

    def keep() -> None:
        kept = Settings(folder / "desktop.ini")
        kept.theme = "light"
        kept.keep_camera("camera", {"text": "x" * 9000})
        kept.save()

    output = tried(keep)
    if Settings(folder / "desktop.ini").recent("sessions") != (Path("/kept"),):
        return f"FAULT: settings are lost after {output}"
    return output


def log(folder: Path) -> str:
    """Write into the log."""

    def keep() -> None:
        made = Log(folder / "log")
        made.start()
        logging.getLogger("x").error("y" * 9000)
        made.stop()

    return tried(keep)


def lock(folder: Path) -> str:
    """Take a run's folder."""
    return tried(lambda: RunLock(folder / "run").release())


def begin(root: Path) -> None:
    """Write the older file of every kind."""
    for kind in (*KINDS, *DRAWN):
        (root / kind.name).mkdir()
        kind.write(root / kind.name, 0)
    for name in ("records", "recording", "settings", "log", "run"):
        (root / name).mkdir()
    with Records.open(root / "records" / NAME) as records:
        for _ in range(3):
            records.add(RECORD)
    with RecordingWriter(root / "recording" / "old.gplrec", RecordingHeader()) as writer:
        for number in range(2):
            writer.append(noisy(number), number, float(number))
    kept = Settings(root / "settings" / "desktop.ini")
    kept.add_recent("sessions", Path("/kept"))
    kept.save()


def all_tried(root: Path) -> dict[str, str]:
    """Try to write every kind; return the messages."""
    output = {kind.name: file_kind(kind, root / kind.name) for kind in (*KINDS, *DRAWN)}
    output["records"] = record(root / "records")
    output["new records"] = tried(lambda: Workspace(root / "run" / "workspace").records)
    output["recording"] = go_on_recording(root / "recording")
    output["settings"] = settings(root / "settings")
    output["log"] = log(root)
    output["lock"] = lock(root)
    return output


def left_open(root: Path) -> list[str]:
    """Return the files of the disk that are still open."""
    gc.collect()
    handles = Path("/proc/self/fd").iterdir()
    names = [os.readlink(handle) for handle in handles if handle.exists()]
    return [name for name in names if name.startswith(str(root))]


def main() -> None:
    """Try both disks."""
    root = Path(sys.argv[1])
    logging.raiseExceptions = False
    begin(root)
    filler = fill(root)
    full = all_tried(root)
    full["open files"] = "; ".join(left_open(root)) and f"FAULT: left open: {left_open(root)}"
    filler.unlink()
    remounted = subprocess.run(["mount", "-o", "remount,ro", str(root)], check=False)
    if remounted.returncode:
        print(json.dumps({"full": full, "read-only": {}}))
        return
    print(json.dumps({"full": full, "read-only": all_tried(root)}))


if __name__ == "__main__":
    main()
