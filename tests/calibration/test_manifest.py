"""The sensor library reads only manifests: fast, and as strictly as the whole file."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest
import scene

from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.calibration.manifest import (
    MANIFEST,
    read_summary,
    refuse_damaged_arrays,
)
from gelpolight_core.errors import InputError


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a valid calibration file."""
    path = tmp_path_factory.mktemp("calibration") / "good.gplcal"
    write_calibration(scene.calibration(), path)
    return path


def forged(whole: Path, target: Path, path: tuple[str, ...], value: Any) -> Path:
    """Return a copy with one changed value in the manifest and a recomputed checksum."""
    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(target, "w") as new:
        manifest = json.loads(old.read(MANIFEST))
        place = manifest
        for key in path[:-1]:
            place = place[key]
        if value is None:
            del place[path[-1]]
        else:
            place[path[-1]] = value
        text = json.dumps(manifest).encode()
        new.writestr(MANIFEST, text)
        new.writestr(f"{MANIFEST}.sha256", hashlib.sha256(text).hexdigest())
        for name in old.namelist():
            if name.endswith(".npy"):
                new.writestr(name, old.read(name))
    return target


def test_the_summary_says_what_the_calibration_says(whole: Path) -> None:
    summary, calibration = read_summary(whole), scene.calibration()
    assert summary.identity == calibration.identity
    assert summary.serial == calibration.serial
    assert summary.model == calibration.model
    assert summary.created == calibration.provenance.created
    assert summary.quality == calibration.quality
    assert summary.verdict is calibration.verdict
    assert summary.image_size == (calibration.camera.width, calibration.camera.height)


def test_a_list_of_calibrations_loads_no_numerical_library() -> None:
    """The window opens before the libraries are loaded."""
    program = (
        "import sys, app.workspace.workspace;"
        "print([m for m in ('scipy', 'numba', 'cv2', 'numpy') if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=Path(__file__).resolve().parents[2],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == "[]"


def test_a_damaged_array_is_found_before_it_is_copied(whole: Path, tmp_path: Path) -> None:
    refuse_damaged_arrays(whole)
    digest = {"shape": [3, 3], "kind": "<f8", "sha256": "0" * 64}
    damaged = forged(whole, tmp_path / "d.gplcal", ("arrays", "crosstalk"), digest)
    with pytest.raises(InputError, match="crosstalk"):
        refuse_damaged_arrays(damaged)
