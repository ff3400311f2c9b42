"""Every control can be reached and read: no page is cut at any supported size."""

import pytest
from layout_walk import walk


@pytest.mark.function("Read all text in both themes, at any size of the window")
def test_nothing_is_cut_on_any_page_at_four_sizes(context):
    assert list(walk(context)) == []
