"""Texts in the user's language.

The source contains English; ``locale/`` has a catalogue for each other language, which
``packaging/translations.py`` updates from the source.
"""

from __future__ import annotations

import gettext
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

LANGUAGES = {"en": "English", "de": "Deutsch"}
CATALOGUES = Path(__file__).parent / "locale"
_DOMAIN = "gelpolight"
# In the order in which the gettext tools ask them.
_VARIABLES = ("LANGUAGE", "LC_ALL", "LC_MESSAGES", "LANG")


def catalogue_path(language: str) -> Path:
    """Return the editable catalogue of a language; its compiled form ends in ``.mo``."""
    return CATALOGUES / language / "LC_MESSAGES" / f"{_DOMAIN}.po"


def system_language() -> str:
    """Return the first language of the environment that the program has, else English."""
    wanted = next((os.environ[name] for name in _VARIABLES if os.environ.get(name)), "")
    codes = (part.partition(".")[0].partition("_")[0].lower() for part in wanted.split(":"))
    return next((code for code in codes if code in LANGUAGES), "en")


def use_language(code: str) -> None:
    """Translate all following texts into a language.

    Modules keep the texts that they translated when they were imported, so call this first.

    Parameters
    ----------
    code : str
        A key of :data:`LANGUAGES`. Any other code gives the language of the environment.
    """
    global _catalogue, _language
    _language = code if code in LANGUAGES else system_language()
    _catalogue = (
        gettext.NullTranslations()
        if _language == "en"
        else gettext.translation(_DOMAIN, CATALOGUES, [_language])
    )


def current_language() -> str:
    """Return the language in use, a key of :data:`LANGUAGES`."""
    return _language


class Text(str):
    """A text in the user's language that also knows its English, which files hold.

    Attributes
    ----------
    english : str
        The same text in English.
    """

    english: str

    def __new__(cls, shown: str, english: str) -> Text:
        """Return a text that is shown as `shown`."""
        text = super().__new__(cls, shown)
        text.english = english
        return text

    def format(self, *args: object, **values: Any) -> Text:
        """Return the text with its placeholders filled; they have names."""
        in_english = {
            name: english(value) if isinstance(value, str) else value
            for name, value in values.items()
        }
        return Text(super().format(*args, **values), self.english.format(*args, **in_english))

    def __reduce__(self) -> tuple[type[Text], tuple[str, str]]:
        """Return what a copy is made from."""
        return Text, (str(self), self.english)


def english(text: str) -> str:
    """Return a text in English; one that is not from the program, such as a note, as it is."""
    return text.english if isinstance(text, Text) else text


def tr(text: str) -> str:
    """Return `text` in the user's language; fill placeholders afterwards with ``format``."""
    return translated(text)


def pattern(template: str, **values: Any) -> str:
    """Return texts put together by a template that needs no translation, such as ``{a}. {b}``."""
    return Text(template, template).format(**values)


def joined(separator: str, parts: Iterable[str]) -> str:
    """Return texts with a separator between them."""
    texts = list(parts)
    return Text(separator.join(texts), separator.join(map(english, texts)))


def marked(text: str) -> str:
    """Return `text` unchanged: it is added to the catalogues; :func:`translated` shows it."""
    return text


def translated(text: str) -> Text:
    """Return a :func:`marked` text in the user's language; one that already is, unchanged."""
    if isinstance(text, Text):
        return text
    return Text(_catalogue.gettext(text) if text else "", str(text))


_catalogue: gettext.NullTranslations
_language: str
use_language("")
