"""The workspace: nothing is lost, broken files are shown, only tested ones count as validated."""

import errno
import json
import os
import shutil
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest
import scene

from app.program.calibration_entries import read_entry
from app.program.workspace import Workspace, folder_name
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.annotations import write_reason, write_validation
from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
from gelpolight_core.calibration.manifest import read_summary
from gelpolight_core.session.validation import FORMAT, VERSION, Validation, validation_path

GOOD = Quantity("height", 1.02, truth=1.0, limit_percent=8.0)
BAD = Quantity("diameter", 5.6, truth=5.0, limit_percent=5.0)
OPEN = Quantity("diameter", 5.1, 0.15, truth=5.0, limit_percent=5.0)


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """Return a calibration file outside the library."""
    path = tmp_path_factory.mktemp("elsewhere") / "made here.gplcal"
    write_calibration(scene.calibration(), path)
    return path


@pytest.fixture
def workspace(tmp_path):
    return Workspace(tmp_path / "workspace")


def trial(path: Path, *comparisons: Quantity) -> Validation:
    return Validation(
        read_summary(path).identity, "2026-03-01T12:00:00+00:00", "Ada", "cylinder", comparisons
    )


@pytest.mark.function("See which sensor folders cannot be read, and why")
def test_a_folder_that_nobody_may_list_is_shown_with_its_cause(workspace, source, monkeypatch):
    good = workspace.import_calibration(source)
    workspace.sensor_folder("B-2").mkdir()
    denied = {workspace.sensor_folder("B-2")}
    list_folder = os.listdir

    def listdir(folder: Path) -> list[str]:
        if Path(folder) in denied:
            raise PermissionError(errno.EACCES, "Permission denied", str(folder))
        return list_folder(folder)

    monkeypatch.setattr(os, "listdir", listdir)
    found = {entry.path.parent.name: "permission" in entry.broken for entry in workspace.entries()}
    assert found == {good.parent.name: False, "B-2": True}
    with pytest.raises(InputError, match="permission"):
        workspace.remove(workspace.sensor_folder("B-2") / "*.gplcal", lambda _file: True)


def test_a_failed_calibration_is_a_draft_that_is_used_only_with_a_reason(workspace):
    path = workspace.keep_calibration(scene.failed(scene.calibration()), "monday")
    (entry,) = workspace.entries()
    assert (entry.name, entry.state) == ("monday-draft", ("failed", "fail"))
    with pytest.raises(InputError, match="Half a pixel") as refusal:
        workspace.use(path)
    assert "reason" in refusal.value.advice
    assert workspace.in_use is None
    write_reason("only to look at the image", path)
    workspace.use(path)
    assert workspace.in_use == path


def test_an_imported_calibration_is_kept_once_with_its_sensor(workspace, source):
    place = workspace.import_calibration(source)
    assert place.parent == workspace.sensor_folder(read_summary(source).serial)
    assert place.read_bytes() == source.read_bytes()
    assert workspace.import_calibration(source) == place
    (entry,) = workspace.entries()
    assert entry.path == place
    assert not entry.broken and not entry.validated
    made = entry.created
    assert entry.age_days(made + timedelta(days=12)) == pytest.approx(12.0)
    assert entry.age_days(made - timedelta(days=1)) == 0.0


def test_another_file_of_the_same_name_overwrites_nothing(workspace, source, tmp_path):
    first = workspace.import_calibration(source)
    old = scene.calibration()
    made = replace(old.provenance, created="2020-01-01T00:00:00+00:00")
    leds_mm = old.data.led_positions_mm + 0.01
    other = replace(old, provenance=made).changed(led_positions_mm=leds_mm)
    write_calibration(other, tmp_path / source.name)
    second = workspace.import_calibration(tmp_path / source.name)
    assert second != first
    assert [e.path for e in workspace.entries()] == [first, second]  # newest first


def test_a_broken_file_is_listed_with_its_reason(workspace, source):
    place = workspace.import_calibration(source)
    place.with_name("half.gplcal").write_bytes(source.read_bytes()[:500])
    place.with_name("folder.gplcal").mkdir()
    entries = {entry.path.name: entry for entry in workspace.entries()}
    assert set(entries) == {place.name, "half.gplcal", "folder.gplcal"}
    assert "damaged" in entries["half.gplcal"].broken
    assert entries["half.gplcal"].serial == place.parent.name
    assert not entries["half.gplcal"].validated
    with pytest.raises(InputError):
        workspace.import_calibration(place.with_name("half.gplcal"))
    assert len(workspace.entries()) == 3


def test_a_file_of_another_kind_is_refused_by_its_name(workspace, tmp_path):
    photo = tmp_path / "photo.png"
    photo.write_bytes(b"\x89PNG")
    with pytest.raises(InputError, match="not a calibration") as refusal:
        workspace.import_calibration(photo)
    assert refusal.value.where == photo.name


def test_a_removed_calibration_leaves_with_its_validation_and_an_older_trash_stays(
    workspace, source
):
    place = workspace.import_calibration(source)
    write_beside(trial(place, GOOD), place)
    workspace.use(place)
    older = workspace.folder / "trash" / "20260101-120000-A-001" / "old.gplcal"
    older.parent.mkdir(parents=True)
    shutil.copy(source, older)
    with pytest.raises(InputError, match="not deleted"):
        workspace.remove(place, lambda _file: False)
    assert workspace.in_use == place and read_entry(place).validated
    gone = workspace.folder / "gone"
    gone.mkdir()
    workspace.remove(place, lambda file: bool(shutil.move(file, gone)))
    assert workspace.entries() == ()
    assert workspace.in_use is None
    assert read_entry(gone / place.name).validated
    assert older.read_bytes() == source.read_bytes()


def test_a_renamed_calibration_keeps_its_content_its_validation_and_its_use(workspace, source):
    place = workspace.import_calibration(source)
    write_beside(trial(place, GOOD), place)
    workspace.use(place)
    content, identity = place.read_bytes(), read_entry(place).summary.identity
    renamed = workspace.rename(place, "After the new gel")
    assert renamed.read_bytes() == content and not place.exists()
    again = Workspace(workspace.folder)
    (entry,) = again.entries()
    assert (entry.path, entry.name) == (again.in_use, "After_the_new_gel")
    assert entry.validated and entry.summary.identity == identity


def test_a_name_that_another_calibration_has_is_refused(workspace, source, tmp_path):
    first = workspace.import_calibration(source)
    other = workspace.keep_calibration(scene.failed(scene.calibration()), "other")
    with pytest.raises(InputError, match="has this name"):
        workspace.rename(other, first.stem)
    assert first.read_bytes() == source.read_bytes() and other.exists()


def test_each_window_of_the_program_has_its_own_calibration_in_use(workspace, source):
    one = workspace.import_calibration(source)
    two = workspace.calibration_path("other", "two")
    shutil.copy(one, two)
    workspace.use(one)
    window = Workspace(workspace.folder)
    assert window.in_use == one
    window.use(two)
    assert (workspace.in_use, window.in_use) == (one, two)
    assert Workspace(workspace.folder).in_use == two


@pytest.mark.function("Move the workspace to another folder")
def test_the_folder_can_be_moved(workspace, source, tmp_path):
    place = workspace.import_calibration(source)
    workspace.use(place)
    moved = Workspace(tmp_path / "moved")
    shutil.move(workspace.folder, moved.folder)
    assert moved.in_use == moved.folder / place.relative_to(workspace.folder)
    for action in (workspace.use, lambda path: workspace.remove(path, lambda _file: True)):
        with pytest.raises(InputError, match="not in the library"):
            action(source)
    assert source.is_file()


def test_only_a_passed_trial_validates(workspace, source):
    place = workspace.import_calibration(source)
    for word, comparisons in (
        ("validation failed", (BAD,)),
        ("validation failed", (GOOD, BAD)),
        ("validation failed", ()),
        ("validation not decidable", (GOOD, OPEN)),
    ):
        write_validation(trial(place, *comparisons), place)
        entry = read_entry(place)
        assert entry.validation is not None
        assert not entry.validated and entry.state == (word, "warn")
    write_validation(trial(place, GOOD), place)
    entry = read_entry(place)
    assert entry.validation == trial(place, GOOD)
    assert entry.validated
    write_reason("for teaching", place)
    assert read_entry(place).validated
    assert not validation_path(place).exists()


def write_beside(validation: Validation, path: Path, **forged: bool) -> None:
    """Write a validation as older programs did."""
    content = {"format": FORMAT, "version": VERSION, **validation.as_json(), **forged}
    validation_path(path).write_text(json.dumps(content))


@pytest.mark.function("Import a calibration, with its validation")
@pytest.mark.parametrize("write", [write_validation, write_beside])
def test_a_validation_is_imported_with_its_calibration(workspace, source, tmp_path, write):
    copy = tmp_path / "copy.gplcal"
    shutil.copy(source, copy)
    write(trial(copy, GOOD), copy)
    place = workspace.import_calibration(copy)
    assert read_entry(place).validated
    assert read_calibration(place).validation == trial(copy, GOOD)


def test_a_trial_of_another_calibration_does_not_validate(workspace, source):
    place = workspace.import_calibration(source)
    another = replace(trial(place, GOOD), identity="another")
    write_validation(another, place)
    write_beside(another, place)
    assert read_entry(place).validation is None
    made = read_calibration(place)
    write_calibration(
        replace(made, validation=trial(place, GOOD)).changed(factors=2.0 * made.data.factors), place
    )
    assert read_entry(place).validation is None
    # Nor does a verdict that does not match its lengths.
    write_beside(trial(place, BAD), place, passed=True)
    entry = read_entry(place)
    assert not entry.validated and not entry.broken


def test_sessions_are_listed_by_sensor_the_last_changed_first(workspace):
    for number, (serial, name) in enumerate((("B-1", "old"), ("B-1", "new"), ("A-1", "x"))):
        folder = workspace.sessions_folder(serial) / name
        (folder / "mirror").mkdir(parents=True)
        for image in range(number):
            (folder / "mirror" / f"{image}.png").write_bytes(b"")
        (folder / "mirror" / ".half.png").write_bytes(b"")
        (folder / "session.toml").write_text(f'[sensor]\nserial = "{serial}"\n')
        for path in (folder / "session.toml", folder / "mirror"):
            os.utime(path, (number, number))
    found = workspace.sessions()
    assert [(e.serial, e.folder.name, e.images) for e in found] == [
        ("A-1", "x", 2),
        ("B-1", "new", 1),
        ("B-1", "old", 0),
    ]
    spoilt = workspace.sessions_folder("C-1") / "spoilt"
    spoilt.mkdir(parents=True)
    (spoilt / "session.toml").write_text("sensor = [")
    assert "C-1" in [e.serial for e in workspace.sessions()], "it cannot be read"


def test_a_calibration_is_not_imported_without_its_validation(workspace, source, tmp_path):
    copied = tmp_path / source.name
    shutil.copy(source, copied)
    write_beside(trial(copied, GOOD), copied)
    serial = read_summary(source).serial
    place = workspace.sensor_folder(serial) / f"{folder_name(copied.stem)}.gplcal"
    in_the_way = validation_path(place)
    in_the_way.mkdir(parents=True)
    with pytest.raises(InputError, match="A folder has the name of the file"):
        workspace.import_calibration(copied)
    assert workspace.entries() == ()
    in_the_way.rmdir()
    assert read_entry(workspace.import_calibration(copied)).validated
