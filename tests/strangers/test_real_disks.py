"""A small disk that is really full, and one that can really only be read."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
MOUNT = 'mount -t tmpfs -o size=24m tmpfs "$1" && exec "$2" "$3" "$1"'
# Where the last bytes of a disk are still free inside of what a file has already.
MAY_BE_WRITTEN = ("refusal of a press", "measurements of a run", "frames of a batch", "lock")
# They tell nobody: what they would keep is no work of a person's.
SILENT = ("settings", "log")


@pytest.fixture(scope="module")
def output(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, str]]:
    """Return the message for each kind of file on both disks."""
    if shutil.which("unshare") is None:
        pytest.skip("no disk of their own for tests on this system")
    place = tmp_path_factory.mktemp("disk")
    apart = ["unshare", "--mount", "--map-root-user", "sh", "-c"]
    may = subprocess.run([*apart, 'mount -t tmpfs tmpfs "$1"', "sh", str(place)], check=False)
    if may.returncode:
        pytest.skip("tests may not mount a disk here")
    trial = str(HERE / "disk_trial.py")
    done = subprocess.run(
        [*apart, MOUNT, "sh", str(place), sys.executable, trial],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (HERE, *HERE.parents[:2])))},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize(
    ("disk", "words"),
    [("full", "The disk is full|No space left"), ("read-only", "read-only|Read-only")],
)
def test_every_kind_of_file_is_refused_in_a_sentence_and_nothing_is_lost(
    output: dict[str, dict[str, str]], disk: str, words: str
) -> None:
    wrong = {}
    for name, sentence in output[disk].items():
        if not sentence:
            continue
        if sentence.startswith("FAULT"):
            wrong[name] = sentence
        elif sentence == "written":
            if name not in SILENT and not (disk == "full" and name in MAY_BE_WRITTEN):
                wrong[name] = sentence
        elif not any(word in sentence for word in words.split("|")):
            wrong[name] = sentence
    assert not wrong
