"""Every export format is in the docstring, and every fault of an image has a row in its page."""

from chapter import DOCS

import gelpolight_core as gp
from gelpolight_core.health.faults import FAULTS
from gelpolight_core.output.formats import HEIGHT_MAP_FORMATS


def test_the_library_names_every_format():
    for key, row in HEIGHT_MAP_FORMATS.items():
        assert f"``{key}``: {row.title}." in gp.write_height_map.__doc__


def test_every_fault_has_a_row_in_the_page_on_health():
    page = (DOCS / "reference/health.md").read_text("utf-8")
    assert [fault.key for fault in FAULTS if f"| `{fault.key}` |" not in page] == []
