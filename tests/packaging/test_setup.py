"""The set-up of a checkout on a bare machine."""

import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ("sh", "dirname", "cat", "sha256sum", "cut")
# A system with apt-get, without libraries, whose user may not install anything.
BARE = {"id": "echo 1000", "apt-get": "exit 1", "ldconfig": "echo 'libEGL.so.1 (libc6) => here'"}


def test_a_user_without_rights_reads_all_missing_packages_in_one_line(tmp_path):
    (tmp_path / "packaging").mkdir()
    for name in ("setup.sh", "requirements.lock", "requirements-dev.lock"):
        shutil.copy(ROOT / "packaging" / name, tmp_path / "packaging")
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    commands = tmp_path / "bin"
    commands.mkdir()
    for name in TOOLS:
        (commands / name).symlink_to(str(shutil.which(name)))
    for name, does in BARE.items():
        (commands / name).write_text(f"#!/bin/sh\n{does}\n")
        (commands / name).chmod(0o755)
    done = subprocess.run(
        ["sh", "packaging/setup.sh", "test"],
        cwd=tmp_path,
        env={"PATH": str(commands)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    packages = line.partition("apt-get install ")[2].partition('"')[0].split()
    assert {"python3", "python3-venv", "libgl1", "xvfb", "poppler-utils"} <= set(packages)
    assert "libegl1" not in packages, "it is there"
    assert len(packages) == len(set(packages))
