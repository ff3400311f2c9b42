"""List the licences of everything in a frozen build; refuse what may not be in it.

    python packaging/licences.py CONTENTS.json LICENCES.txt

CONTENTS.json holds pairs: place in the build, file it is made from. packaging/gelpolight.spec
writes it and calls this, so that no build is made without its licences. The Python is the one that
the build is made with. Every file must belong to something whose licence is known: the project, an
installed package, Python, or a library of the system.
"""

from __future__ import annotations

import json
import platform
import re
import subprocess
import sys
import sysconfig
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from importlib.metadata import Distribution, distributions
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
OURS = tuple(ROOT / name for name in ("app", "gelpolight_core", "resources"))
# What is not ours of the documentation; packaging/docs.sh puts its licence beside it.
THEME = ROOT / "resources" / "site" / "LICENSE-theme.txt"
FILE = "LICENCES.txt"
TEXTS = Path(__file__).resolve().parent / "licence-texts"
TABLE_NAME = "packaging/licences.toml"
TABLE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
LIBRARY = re.compile(r"\.(so(\.|$)|dll$|dylib$)")
EXTENSION = re.compile(r"\.(cpython-\d+[\w-]*|abi3)\.so$")
LEGAL = re.compile(r"(LICEN[CS]E|COPYING|NOTICE|AUTHORS)", re.IGNORECASE)
CLASSIFIERS = {
    "Apache Software License": "Apache-2.0",
    "BSD License": "BSD-3-Clause",
    "MIT License": "MIT",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "Python Software Foundation License": "PSF-2.0",
}

INTRODUCTION = """\
Licences of everything in this build of GelPoLight Studio

GelPoLight Studio itself is under the BSD 3-Clause licence, whose text comes first.

Libraries under the LGPL (Qt and PySide6 with Shiboken, version 3; FFmpeg and libquadmath, version
2.1 or later) are shared libraries in files of their own beside the program. You may replace them by
versions of your own that have the same interface: put your files in the place of those that the
list names; nothing checks that they are the same. You may take the program apart in order to find
faults in such changes. Their sources, which were not changed for this build, are at
https://download.qt.io/official_releases/ (QtForPython and qt, in the version named below),
https://ffmpeg.org/releases/ and https://gcc.gnu.org/releases.html ; whoever gave you this build
owes you them on request, for three years at least. What Qt itself contains of others is listed at
https://doc.qt.io/qt-6/licenses-used-in-qt.html .
"""


class RefusedError(Exception):
    """Something may not be in the build, or nobody knows its licence."""


@dataclass
class Part:
    """What has a licence of its own, and where it is in the build."""

    name: str
    version: str
    licence: str
    texts: dict[str, str] = field(default_factory=dict)
    places: list[str] = field(default_factory=list)


def is_allowed(licence: str) -> bool:
    """Whether an SPDX expression leaves us a choice without the plain GPL."""
    terms = re.findall(r"[()]|[\w.+-]+", licence)

    def one_of() -> bool:
        found = all_of()
        while terms and terms[0].upper() == "OR":
            terms.pop(0)
            found = all_of() or found
        return found

    def all_of() -> bool:
        found = single()
        while terms and terms[0].upper() == "AND":
            terms.pop(0)
            found = single() and found
        return found

    def single() -> bool:
        if not terms:
            terms.append("an end too early")  # is left over: the whole is not understood
            return False
        name = terms.pop(0)
        if name == "(":
            found = one_of()
            return bool(terms) and terms.pop(0) == ")" and found
        if terms and terms[0].upper() == "WITH":
            terms.pop(0)
            return bool(terms) and terms.pop(0) in TABLE["exceptions"]
        return name in TABLE["allowed"]

    return one_of() and not terms


def licence_of(package: Distribution) -> str:
    """Return a package's licence as its metadata or our table say it."""
    data = package.metadata
    reported = TABLE["packages"].get(_plain(data["Name"])) or data.get("License-Expression")
    if reported:
        return str(reported)
    kinds = [c.split(" :: ")[-1] for c in data.get_all("Classifier", []) if c.startswith("License")]
    if any("General Public" in kind and "Lesser" not in kind for kind in kinds):
        return "; ".join(kinds)
    free = str(data.get("License") or "")
    return free if is_allowed(free) else " AND ".join(CLASSIFIERS.get(k, k) for k in kinds) or free


def collect(contents: Iterable[tuple[str, str]]) -> list[Part]:
    """Return the parts that a build is made of.

    Raises
    ------
    RefusedError
        If one of them may not be in a build, or is not known.
    """
    owners = {
        _resolved(Path(str(package.locate_file(file)))): package
        for package in distributions()
        for file in package.files or ()
    }
    parts: dict[str, Part] = {}
    refused: list[str] = []

    def add(part: Part, place: str) -> None:
        known = parts.setdefault(part.name, part)
        known.texts.update(part.texts)
        if part.version not in known.version:
            known.version += f", {part.version}"
        known.places.append(place)

    packages = {package.name: _of_package(package) for package in distributions()}
    add(packages["pyinstaller"], "the program file")
    for place, source in contents:
        path = _resolved(Path(source))
        package = owners.get(path)
        of_theme = path == THEME
        if not Path(source).is_absolute() or (any(map(path.is_relative_to, OURS)) and not of_theme):
            continue  # links to what is listed, and the project's own
        try:
            if of_theme:
                add(_theme(), place)
            elif package is not None:
                own = packages[package.name]
                add(_of_library(place, path, own) or own, place)
            elif place == "base_library.zip" or path.is_relative_to(_standard_library()):
                add(_python(), place)
            else:
                add(_of_system(path), place)
        except RefusedError as error:
            refused.append(str(error))
    refused += [
        f"{part.name} is under {part.licence or 'no licence that it names'}, which is not allowed"
        for part in parts.values()
        if not is_allowed(part.licence)
    ]
    if refused:
        raise RefusedError("\n".join(dict.fromkeys(refused)))
    return sorted(parts.values(), key=lambda part: part.name.lower())


def _of_package(package: Distribution) -> Part:
    texts = {
        f"{package.name}: {file.name}": Path(str(package.locate_file(file))).read_text(
            "utf-8", "replace"
        )
        for file in package.files or ()
        if LEGAL.match(file.name) and file.parts[0].endswith(".dist-info")
    }
    return Part(package.name, package.version, licence_of(package), texts)


def _of_library(place: str, path: Path, own: Part) -> Part | None:
    """Return what a shared library inside a package is; None where it is the package's own."""
    if not LIBRARY.search(path.name) or EXTENSION.search(path.name) or place.endswith(".pyd"):
        return None
    for row in TABLE["libraries"]:
        if any(fnmatchcase(place.replace("\\", "/"), pattern) for pattern in row["files"]):
            if row["name"] == "own":
                return None
            held = path.read_bytes() if "never_holds" in row else b""
            for word in row.get("never_holds", ()):
                if word.encode() in held:
                    raise RefusedError(f"{place} was built with {word}")
            version = f"in {own.name} {own.version}"
            return Part(row["name"], version, row["licence"], dict(own.texts))
    raise RefusedError(f"{place} comes with {own.name}; its licence is not in {TABLE_NAME}")


def _of_system(path: Path) -> Part:
    """Return the part that a library of the system is, by its Debian package."""
    licence = next((x for name, x in TABLE["system"].items() if path.name.startswith(name)), None)
    if licence is None:
        raise RefusedError(f"{path} belongs to nothing whose licence is known; see {TABLE_NAME}")
    for name in (path, Path("/", *path.parts[2:])):  # Debian knows files of /usr/lib by /lib
        found = subprocess.run(
            ["dpkg-query", "-S", name], capture_output=True, text=True, check=False
        )
        if found.returncode == 0:
            package = found.stdout.split(":")[0]
            break
    else:
        return Part(path.name, "of the system", licence)
    shown = subprocess.run(
        ["dpkg-query", "-W", "-f", "${Version}\n", package],
        capture_output=True,
        text=True,
        check=True,
    )
    text = Path("/usr/share/doc", package, "copyright").read_text("utf-8", "replace")
    return Part(package, shown.stdout.split()[0], licence, {f"{package}: copyright": text})


def _python() -> Part:
    text = next(
        (
            f.read_text("utf-8")
            for f in (_standard_library() / "LICENSE.txt", Path(sys.base_prefix, "LICENSE.txt"))
            if f.is_file()
        ),
        "https://docs.python.org/3/license.html",
    )
    return Part("Python", platform.python_version(), "PSF-2.0", {"Python: LICENSE": text})


def _theme() -> Part:
    name = "MkDocs theme of ProperDocs"
    text = THEME.read_text("utf-8")
    return Part(name, "in the documentation", "BSD-2-Clause", {f"{name}: LICENSE": text})


def _standard_library() -> Path:
    return _resolved(Path(sysconfig.get_path("stdlib")))


def _resolved(path: Path) -> Path:
    return path.resolve()


def _plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def written(parts: Iterable[Part]) -> str:
    """Return the file that goes with a build: the list, then every text once."""
    parts = list(parts)
    width = max(len(f"{part.name} {part.version}") for part in parts)
    lines = [INTRODUCTION, "What is in it", ""]
    for part in parts:
        lines.append(f"{f'{part.name} {part.version}':{width}}  {part.licence}")
        if "GPL" in part.licence:
            lines += [f"    {place}" for place in sorted(part.places) if LIBRARY.search(place)]
    texts = {"GelPoLight Studio": (ROOT / "LICENSE").read_text("utf-8")}
    for part in parts:
        texts.update(part.texts)
    for path in sorted(TEXTS.glob("*.txt")):
        texts[path.stem] = path.read_text("utf-8")
    seen: set[str] = set()
    for title, text in texts.items():
        if text not in seen:
            seen.add(text)
            lines += ["", "=" * 80, title, "=" * 80, "", text.rstrip()]
    return "\n".join(lines) + "\n"


def main(arguments: list[str]) -> None:
    """Write the licences of a build's contents, or end with what is refused."""
    contents, out = map(Path, arguments)
    try:
        parts = collect(json.loads(contents.read_text("utf-8")))
    except RefusedError as error:
        sys.exit(f"The licences forbid this build:\n{error}")
    out.write_text(written(parts), "utf-8")
    print(f"Licences of {len(parts)} parts: {out}")


if __name__ == "__main__":
    main(sys.argv[1:])
