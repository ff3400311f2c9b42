"""The power is cut in the middle of a write: the older file or the newer one, never a mixture."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from recorded import noisy
from written import KINDS, calibration

from app.program.workspace import Workspace
from gelpolight_core.calibration.calibration_file import write_calibration
from gelpolight_core.lab.press_folder import add_presses
from gelpolight_core.lab.reference_press import listed_presses
from gelpolight_core.session.reference_object import ReferenceObject
from gelpolight_core.session.session_images import write_image


@pytest.mark.function("Lose power without half a file")
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_bytes_are_on_the_disk_before_their_name_and_the_name_before_all_else(
    kind, tmp_path, monkeypatch
):
    kind.write(tmp_path, 0)
    calls: list[tuple[str, str]] = []

    def noted(name: str, act: Callable[..., Any]) -> Callable[..., Any]:
        def call(first: Any, *others: Any, **options: Any) -> Any:
            where = os.readlink(f"/proc/self/fd/{first}") if name == "fsync" else str(first)
            calls.append((name, where))
            return act(first, *others, **options)

        return call

    for name in ("fsync", "replace", "link"):
        monkeypatch.setattr(os, name, noted(name, getattr(os, name)))
    kind.write(tmp_path, 1)
    named = [place for place, (name, _) in enumerate(calls) if name in ("replace", "link")]
    assert calls
    for place in named:
        assert calls[place - 1] == ("fsync", calls[place][1])
        assert calls[place + 1] == ("fsync", str(Path(calls[place][1]).parent))


def test_half_a_file_under_its_first_name_is_no_file_of_anybody(tmp_path):
    """A cut leaves a part of the file that was to take the older one's place."""
    workspace = Workspace(tmp_path / "workspace")
    path = workspace.calibration_path("T-1", "c")
    write_calibration(calibration(), path)
    whole = path.read_bytes()
    folder = tmp_path / "presses"
    (file,) = add_presses(folder, ReferenceObject("ball", 3.0), 1)
    image = folder / file
    write_image(noisy(0), image)
    workspace.use(path)
    for size in (0, 1, 100, len(whole) // 2, len(whole) - 1):
        for old in (path, image, image.with_name("truth.csv"), workspace.folder / "w.json"):
            (old.parent / f".{old.name}.0badcafe.part").write_bytes(whole[:size])
        assert [entry.path for entry in workspace.entries()] == [path]
        assert workspace.in_use == path
        assert [press.file for press in listed_presses(folder)] == [file]
