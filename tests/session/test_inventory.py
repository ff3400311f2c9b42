"""The files of a session are the same for all who ask, and what changed is noticed."""

import os

from gelpolight_core.session.inventory import SessionInventory


def test_a_file_is_looked_into_again_only_after_it_has_changed(tmp_path):
    folder = tmp_path / "balls"
    folder.mkdir()
    for name in ("a.png", "b.png"):
        (folder / name).write_bytes(name.encode())
    before = SessionInventory(tmp_path)
    hashes = [image.sha256 for image in before.stage("balls").images]
    assert before.refreshed() is before
    (folder / "b.png").write_bytes(b"other")
    (folder / "c.png").write_bytes(b"new")
    # Other content of the same size and time: taken as unchanged, without reading it.
    times = os.stat(folder / "a.png").st_atime_ns, os.stat(folder / "a.png").st_mtime_ns
    (folder / "a.png").write_bytes(b"A.png")
    os.utime(folder / "a.png", ns=times)
    assert [image.path.name for image in before.stage("balls").images] == ["a.png", "b.png"]
    after = before.refreshed().stage("balls").images
    assert [image.path.name for image in after] == ["a.png", "b.png", "c.png"]
    assert after[0].sha256 == hashes[0]
    assert after[1].sha256 != hashes[1]


def test_files_that_a_system_writes_into_a_folder_count_as_nothing(tmp_path):
    (tmp_path / "balls").mkdir()
    for name in ("Thumbs.db", "desktop.ini", ".DS_Store", "notes.txt"):
        (tmp_path / "balls" / name).write_bytes(b"x")
    others = SessionInventory(tmp_path).stage("balls").others
    assert [path.name for path in others] == ["notes.txt"]


def test_an_unreadable_or_absent_file_is_no_size_and_an_absent_stage_is_empty(tmp_path):
    (tmp_path / "balls").mkdir()
    (tmp_path / "balls" / "a.png").write_bytes(b"x")
    inventory = SessionInventory(tmp_path)
    (image,) = inventory.stage("balls").images
    assert image.size_px is None
    assert inventory.stage("mirror") == ((), ())
