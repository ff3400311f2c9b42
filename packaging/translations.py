"""Update the catalogues of translations from the source.

    python packaging/translations.py           update and compile every catalogue
    python packaging/translations.py missing   print the texts without a translation, as JSON;
                                               nothing is written

Translate with any editor of .po files, then run it again.
"""

from __future__ import annotations

import ast
import json
import sys
from collections.abc import Iterator
from pathlib import Path

from babel.messages.catalog import Catalog
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po, write_po

from gelpolight_core import __version__
from gelpolight_core.translation import LANGUAGES, catalogue_path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("app", "gelpolight_core")
FUNCTIONS = ("tr", "marked")


def texts_of(path: Path) -> Iterator[str]:
    """Yield the texts of a module that are translated."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Call) and getattr(node.func, "id", None) in FUNCTIONS:
            for given in node.args[:1]:
                if isinstance(given, ast.Constant) and isinstance(given.value, str) and given.value:
                    yield given.value


def template() -> Catalog:
    """Return all texts of the source with the files that contain them."""
    catalogue = Catalog(project="GelPoLight Studio", charset="utf-8")
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for text in texts_of(path):
                catalogue.add(text, locations=[(path.relative_to(ROOT).as_posix(), 0)])
    return catalogue


def read(language: str) -> Catalog:
    """Return the catalogue of a language, empty if there is none yet."""
    path = catalogue_path(language)
    if not path.is_file():
        return Catalog(locale=language, charset="utf-8")
    with path.open("rb") as file:
        return read_po(file, locale=language)


def updated(language: str) -> Catalog:
    """Return the catalogue of a language with the texts of today."""
    catalogue = read(language)
    catalogue.update(template(), no_fuzzy_matching=True)
    catalogue.obsolete.clear()
    catalogue.project, catalogue.version, catalogue.fuzzy = "GelPoLight Studio", __version__, False
    catalogue.header_comment = f"# {LANGUAGES[language]}: made by packaging/translations.py."
    return catalogue


def write(catalogue: Catalog, language: str) -> None:
    """Write the catalogue of a language, and its compiled form."""
    path = catalogue_path(language)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        write_po(file, catalogue, width=100, include_lineno=False, sort_output=True)
    with path.with_suffix(".mo").open("wb") as file:
        write_mo(file, catalogue)


def missing(catalogue: Catalog) -> list[str]:
    """Return the texts of a catalogue without a translation."""
    return [str(message.id) for message in catalogue if message.id and not message.string]


def main() -> None:
    """Update all catalogues, or print what is missing."""
    for language in LANGUAGES:
        if language == "en":
            continue
        catalogue = updated(language)
        absent = missing(catalogue)
        if "missing" in sys.argv[1:]:
            print(json.dumps(absent, ensure_ascii=False, indent=0))
        else:
            write(catalogue, language)
            print(f"{language}: {len(catalogue)} texts, {len(absent)} without a translation")


if __name__ == "__main__":
    main()
