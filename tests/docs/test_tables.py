"""The pages have a row for every export format and every fault of an image.

Run as a program, this file writes the table of the export formats into the guide.
"""

import re

from chapter import DOCS

import gelpolight_core as gp
from gelpolight_core.health.fault_findings import FAULTS
from gelpolight_core.output.formats import FORMATS, HEIGHT_MAP_FORMATS

GUIDE = DOCS / "guide/inspect.md"
HEAD = "| format | content |\n|---|---|\n"


def with_formats(page: str) -> str:
    """Return the guide with the rows of all formats."""
    rows = "".join(
        f"| {row.key} | {row.title} |\n" for row in HEIGHT_MAP_FORMATS.values() if row in FORMATS
    )
    return re.sub(rf"(?<={re.escape(HEAD)})(\|.*\n)+", lambda _: rows, page)


def test_the_guide_and_the_library_name_every_format():
    page = GUIDE.read_text("utf-8")
    assert HEAD in page and with_formats(page) == page
    for key, row in HEIGHT_MAP_FORMATS.items():
        assert f"``{key}``: {row.title}." in gp.write_height_map.__doc__


def test_every_fault_has_a_row_in_the_page_on_health():
    page = (DOCS / "reference/health.md").read_text("utf-8")
    assert [fault.key for fault in FAULTS if f"| `{fault.key}` |" not in page] == []


if __name__ == "__main__":
    GUIDE.write_text(with_formats(GUIDE.read_text("utf-8")), "utf-8")
