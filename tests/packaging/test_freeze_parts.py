"""What the frozen program takes along, and what its Debian package says of it."""

import configparser
import os
import re
import subprocess
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import freeze_parts as parts
import frozen_start
import pytest

from app.cli.main import OPENED
from app.program.calibration_entries import ENDING as CALIBRATION
from app.window import documentation
from gelpolight_core.output.recording.recording_format import ENDING as RECORDING

ROOT = Path(__file__).resolve().parents[2]
DEB = ROOT / "packaging" / "deb"
MIME = "{http://www.freedesktop.org/standards/shared-mime-info}"
SITE = "/build/venv/lib/python3.11/site-packages/"


def taken(place: str, source: str = "") -> bool:
    return parts.is_wanted((place, source or SITE + place, "BINARY"))


def test_every_resource_lies_where_the_program_looks_for_it():
    data = {Path(folder, Path(file).name) for file, folder in parts.data_files()}
    assert Path("resources/icons/gelpolight.svg") in data
    assert Path("resources/checkerboards/checkerboard-9x6-3mm.pdf") in data
    assert (
        Path("gelpolight_core/py.typed") in data
        or not (ROOT / "gelpolight_core" / "py.typed").exists()
    )


def test_the_documentation_lies_where_the_program_looks_for_it(monkeypatch, tmp_path):
    monkeypatch.setattr(parts, "ROOT", tmp_path)
    with pytest.raises(FileNotFoundError, match=r"docs\.sh"):
        parts.documentation()
    place = documentation.SITE.relative_to(ROOT)
    for name in ("index.html", "guide/calibrate.html", "sitemap.xml"):
        file = tmp_path / place / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("here", "utf-8")
    build = {Path(folder) / Path(file).name for file, folder in parts.documentation()}
    assert build == {place / "index.html", place / "guide" / "calibrate.html"}


def test_the_data_of_packages_are_those_that_are_installed_with_them():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    assert set(parts.PACKAGE_DATA) == set(project["tool"]["setuptools"]["package-data"]["*"])


def test_no_file_of_the_packages_is_forgotten():
    """A data file of a new kind has to be named in the tables."""
    known = {Path(file) for file, _ in parts.data_files()}
    for package in parts.PACKAGES:
        for path in (ROOT / package).rglob("*"):
            if path.is_file() and path.suffix != ".py" and path.parent.name != "__pycache__":
                assert path in known, path


def test_nothing_that_the_program_imports_is_left_out():
    imported = set()
    for base, names in re.findall(r"^ *from ([\w.]+) import ([\w, ]+)", _sources(), re.MULTILINE):
        imported |= {base, *(f"{base}.{name.strip()}" for name in names.split(","))}
    imported |= set(re.findall(r"^ *import ([\w.]+)", _sources(), re.MULTILINE))
    assert {"PySide6.QtCore", "pyvistaqt.QtInteractor"} <= imported
    # A cluster needs an installation: its workers import the program by themselves.
    left_out = set(parts.LEFT_OUT_MODULES) - {"distributed", "dask"}
    assert not imported & left_out


def _sources() -> str:
    files = [path for package in parts.PACKAGES for path in (ROOT / package).rglob("*.py")]
    return "\n".join(path.read_text("utf-8") for path in files)


@pytest.mark.parametrize(
    "place",
    [
        "PySide6/Qt/plugins/platforms/libqxcb.so",
        "PySide6/Qt/plugins/imageformats/libqsvg.so",
        "PySide6/Qt/lib/libQt6Widgets.so.6",
        "PySide6/plugins/platforms/qwindows.dll",
        "opencv_contrib_python_headless.libs/libssl-81259c47.so.1.1.1k",
        "matplotlib/mpl-data/fonts/ttf/DejaVuSans.ttf",
        "vtkmodules/libvtkRenderingOpenGL2.so",
    ],
)
def test_what_is_needed_is_taken_along(place):
    assert taken(place)


@pytest.mark.parametrize(
    "place",
    [
        "PySide6/Qt/plugins/platformthemes/libqgtk3.so",
        "PySide6/Qt/plugins/tls/libqopensslbackend.so",
        "PySide6/Qt/translations/qtbase_fr.qm",
        "PySide6/Qt/lib/libQt6Network.so.6",
        "matplotlib/mpl-data/sample_data/goog.npz",
    ],
)
def test_what_nothing_uses_is_left_out(place):
    assert not taken(place)


def test_a_changed_module_changes_the_stamp_of_the_compiled_loops(monkeypatch, tmp_path):
    for package in parts.PACKAGES:
        (tmp_path / package).mkdir()
    (tmp_path / "app" / "one.py").write_text("a = 1\n")
    monkeypatch.setattr(parts, "ROOT", tmp_path)
    before = parts.hash_of_sources()
    (tmp_path / "app" / "one.py").write_text("a = 2\n")
    assert parts.hash_of_sources() != before


def test_compiled_loops_and_fonts_are_kept_in_a_folder_of_the_user(monkeypatch, tmp_path):
    monkeypatch.setattr(os, "environ", {})
    frozen_start.choose_caches(tmp_path / "cache")
    assert os.environ["NUMBA_CACHE_DIR"] == str(tmp_path / "cache" / "kernels")
    assert Path(os.environ["MPLCONFIGDIR"]).parent == tmp_path / "cache"


def test_the_desktop_entry_starts_the_program_with_files_of_both_kinds():
    entry = configparser.ConfigParser(interpolation=None)
    entry.optionxform = str  # type: ignore[assignment,method-assign]
    entry.read(DEB / "gelpolight.desktop")
    desktop = entry["Desktop Entry"]
    assert desktop["Type"] == "Application"
    assert desktop["Exec"] == "gelpolight %F"
    assert desktop["Icon"] == "gelpolight"
    assert all(text.endswith(";") for text in (desktop["Categories"], desktop["MimeType"]))
    types = {x.get("type") for x in ET.parse(DEB / "gelpolight.xml").getroot()}
    assert set(desktop["MimeType"].strip(";").split(";")) == types


def test_the_file_types_are_those_that_the_program_opens():
    globs = [
        found.get("pattern")
        for kind in ET.parse(DEB / "gelpolight.xml").getroot().iter(f"{MIME}mime-type")
        for found in kind.iter(f"{MIME}glob")
    ]
    assert globs == [f"*{ending}" for ending in OPENED] == [f"*{CALIBRATION}", f"*{RECORDING}"]


def test_the_package_asks_for_what_windows_need_on_a_bare_machine():
    script = (ROOT / "packaging" / "freeze.sh").read_text("utf-8")
    command = re.search(r"sed -n '/\^window_libraries.*", script)
    assert command
    asked = subprocess.run(
        ["sh", "-c", command[0]], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()
    listed = re.search(
        r'window_libraries="\n(.*?)"',
        (ROOT / "packaging" / "setup.sh").read_text("utf-8"),
        re.DOTALL,
    )
    assert listed
    assert asked == sorted(line.split()[1] for line in listed[1].splitlines())
    assert "libxcb-cursor0" in asked
