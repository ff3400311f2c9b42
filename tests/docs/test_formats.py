"""The guide names every export format with what it holds."""

from chapter import DOCS

import gelpolight_core as gp
from gelpolight_core.export.formats import HEIGHT_MAP_FORMATS


def test_the_guide_and_the_library_name_every_format():
    page = (DOCS / "guide/inspect.md").read_text("utf-8")
    for key, row in HEIGHT_MAP_FORMATS.items():
        assert f"| {key} | {row.title} |" in page
        assert f"``{key}``: {row.title}." in gp.write_height_map.__doc__
