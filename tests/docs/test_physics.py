"""The chapters name modules that are there, and repeat figures as they were measured."""

import re

import pytest
from chapter import DOCS

CHAPTERS = ("reference/library.md", "reference/physics.md", "reference/quality-figures.md")


@pytest.mark.parametrize("name", CHAPTERS)
def test_every_module_that_a_chapter_names_is_there(name):
    """A module that is renamed is renamed in the documentation."""
    text = (DOCS / name).read_text("utf-8")
    for path in re.findall(r"`((?:gelpolight_core|app)/[\w./]*)`", text):
        assert (DOCS.parent / path).exists(), path
