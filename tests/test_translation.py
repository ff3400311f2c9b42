"""Every text of the program is in each catalogue, translated, with the same placeholders."""

import ast
import gettext
import os
import subprocess
import sys
from pathlib import Path
from string import Formatter

import pytest
import translations

from gelpolight_core.translation import LANGUAGES, catalogue_path, system_language

ROOT = Path(__file__).resolve().parents[1]
OTHERS = [code for code in LANGUAGES if code != "en"]


@pytest.fixture(scope="module")
def source():
    return {str(message.id) for message in translations.template() if message.id}


@pytest.fixture(scope="module", params=OTHERS)
def catalogue(request):
    return translations.read(request.param)


def test_each_catalogue_has_the_texts_of_the_source_and_no_others(source, catalogue):
    texts = {str(message.id) for message in catalogue if message.id}
    assert (source - texts, texts - source) == (set(), set())


def test_each_text_is_translated(catalogue):
    assert translations.missing(catalogue) == []


def test_a_translation_has_the_placeholders_of_its_text(catalogue):
    def fields(text: str) -> list[str]:
        return sorted(str(name) for _, name, *_ in Formatter().parse(text) if name is not None)

    def named(text: str) -> bool:
        try:
            return any(fields(text))
        except ValueError:  # braces that are no placeholders
            return False

    texts = [(str(m.id), str(m.string)) for m in catalogue if m.id]
    wrong = [text for text, other in texts if named(text) and fields(text) != fields(other)]
    assert wrong == []


def test_a_translation_keeps_edges_and_shortcuts_of_its_text(catalogue):
    def form(text: str) -> tuple[int, int, bool, bool]:
        spaced = text[:1].isspace(), text[-1:].isspace()
        return text.count("\n"), text.replace("&&", "").count("&"), *spaced

    texts = [(str(m.id), str(m.string)) for m in catalogue if m.id]
    assert [text for text, other in texts if form(text) != form(other)] == []


def test_the_compiled_catalogue_is_that_of_the_editable_one(catalogue):
    path = catalogue_path(str(catalogue.locale))
    with path.with_suffix(".mo").open("rb") as file:
        compiled = gettext.GNUTranslations(file)
    stale = [m.id for m in catalogue if m.id and compiled.gettext(str(m.id)) != m.string]
    assert stale == []


def test_every_call_names_its_text(source):
    """A text in a variable cannot be extracted."""
    unnamed = []
    for path in (p for package in translations.PACKAGES for p in (ROOT / package).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", None) == "tr":
                if not isinstance(node.args[0], ast.Constant):
                    unnamed.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert unnamed == []


@pytest.mark.parametrize(
    ("variables", "language"),
    [
        ({"LANG": "de_DE.UTF-8"}, "de"),
        ({"LANG": "fr_FR.UTF-8"}, "en"),
        ({"LANGUAGE": "fr:de:en", "LANG": "fr_FR.UTF-8"}, "de"),
        ({"LANGUAGE": "en", "LANG": "de_DE.UTF-8"}, "en"),
        ({"LC_ALL": "C", "LANG": "de_DE.UTF-8"}, "en"),
        ({}, "en"),
    ],
)
def test_the_language_is_that_of_the_system(variables, language, monkeypatch):
    for name in ("LANGUAGE", "LC_ALL", "LC_MESSAGES", "LANG"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert system_language() == language


def test_a_command_answers_in_the_language_of_the_system():
    def answer(language: str) -> str:
        command = [sys.executable, "-m", "app.command_line.main", "inspect", "absent.gplcal"]
        environment = {**os.environ, "LANGUAGE": language}
        run = subprocess.run(
            command, capture_output=True, cwd=ROOT, env=environment, text=True, check=False
        )
        assert run.returncode == 2
        return run.stderr

    assert answer("de") != answer("en")
