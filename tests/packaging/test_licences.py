"""The licences of a build: everything has one, and the plain GPL is refused."""

from email.message import Message
from importlib.metadata import distribution
from pathlib import Path
from types import SimpleNamespace

import licences
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    "licence",
    [
        "MIT",
        "BSD-3-Clause AND (0BSD OR GPL-3.0-only)",
        "LGPL-3.0-only OR GPL-2.0-only OR GPL-3.0-only",
        "GPL-2.0-or-later WITH Bootloader-exception",
        "Apache-2.0 WITH LLVM-exception AND Zlib",
    ],
)
def test_licences_that_leave_the_program_free_are_allowed(licence):
    assert licences.is_allowed(licence)


@pytest.mark.parametrize(
    "licence",
    [
        "GPL-3.0-only",
        "GPL-2.0-or-later OR AGPL-3.0-only",
        "MIT AND GPL-3.0-or-later",
        "(MIT OR Zlib) AND GPL-2.0-only",
        "GPL-2.0-or-later WITH Unheard-exception",
        "GNU General Public License v3",
        "Proprietary",
        "(MIT",
        "MIT OR",
        "",
    ],
)
def test_the_plain_gpl_and_what_is_not_understood_are_refused(licence):
    assert not licences.is_allowed(licence)


def package(tmp_path: Path, **fields: str) -> SimpleNamespace:
    """Return a stand-in for an installed package of one module."""
    metadata = Message()
    for name, value in {"Name": "pieces", **fields}.items():
        metadata[name.replace("_", "-")] = value
    (tmp_path / "pieces.py").write_text("")
    return SimpleNamespace(
        name="pieces",
        version="1",
        metadata=metadata,
        files=[Path("pieces.py")],
        locate_file=lambda file: tmp_path / file,
    )


def collect(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, installed: SimpleNamespace, *places: str
) -> list[licences.Part]:
    """Return the parts of a build of some files of one package and the builder."""
    builder = package(tmp_path, License_Expression="MIT")
    builder.name, builder.metadata["Name"], builder.files = "pyinstaller", "pyinstaller", []
    builder.metadata.replace_header("Name", "pyinstaller")
    monkeypatch.setattr(licences, "distributions", lambda: [installed, builder])
    return licences.collect([(place, str(tmp_path / Path(place).name)) for place in places])


@pytest.mark.parametrize(
    "fields",
    [
        {"License_Expression": "GPL-3.0-or-later"},
        {"License": "GPLv3"},
        {
            "License": "MIT",
            "Classifier": "License :: OSI Approved :: GNU General Public License v3",
        },
        {},
    ],
    ids=["expression", "words", "classifier", "nothing"],
)
def test_a_gpl_package_is_refused_by_name(fields, monkeypatch, tmp_path):
    with pytest.raises(licences.RefusedError, match="pieces is under"):
        collect(monkeypatch, tmp_path, package(tmp_path, **fields), "pieces.py")


def test_a_package_is_listed_with_its_licence(monkeypatch, tmp_path):
    parts = collect(monkeypatch, tmp_path, package(tmp_path, License="MIT"), "pieces.py")
    assert (parts[0].name, parts[0].licence) == ("pieces", "MIT")
    text = licences.written(parts)
    assert "pieces 1" in text
    assert "GNU LESSER GENERAL PUBLIC LICENSE" in text
    assert (ROOT / "LICENSE").read_text("utf-8").strip() in text


def test_a_library_inside_a_package_must_be_known(monkeypatch, tmp_path):
    installed = package(tmp_path, License="MIT")
    installed.files.append(Path("libstrange.so.1"))
    (tmp_path / "libstrange.so.1").write_bytes(b"")
    with pytest.raises(licences.RefusedError, match=r"libstrange\.so\.1 comes with pieces"):
        collect(monkeypatch, tmp_path, installed, "pieces.libs/libstrange.so.1")


def test_ffmpeg_with_gpl_parts_is_refused(monkeypatch, tmp_path):
    installed = package(tmp_path, License="MIT")
    installed.files.append(Path("libavcodec.so.62"))
    (tmp_path / "libavcodec.so.62").write_bytes(b"\0--prefix=/x --enable-gpl\0")
    with pytest.raises(licences.RefusedError, match="--enable-gpl"):
        collect(monkeypatch, tmp_path, installed, "pieces.libs/libavcodec.so.62")
    (tmp_path / "libavcodec.so.62").write_bytes(b"\0--prefix=/x\0")
    parts = collect(monkeypatch, tmp_path, installed, "pieces.libs/libavcodec.so.62")
    assert "LGPL-2.1-or-later" in {part.licence for part in parts}


def test_a_file_that_belongs_to_nobody_is_refused(monkeypatch, tmp_path):
    (tmp_path / "libreadline.so.8").write_bytes(b"")
    with pytest.raises(licences.RefusedError, match=r"libreadline\.so\.8 belongs to nothing"):
        collect(monkeypatch, tmp_path, package(tmp_path, License="MIT"), "libreadline.so.8")


def test_every_dependency_of_the_program_may_be_shipped():
    lock = (ROOT / "packaging" / "requirements.lock").read_text("utf-8")
    names = [
        line.split("==")[0] for line in lock.splitlines() if "==" in line and "sys_" not in line
    ]
    assert len(names) > 20
    for name in names:
        assert licences.is_allowed(licences.licence_of(distribution(name))), name
