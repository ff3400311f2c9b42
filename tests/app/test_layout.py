"""Every control can be reached and read: no page is cut at any supported size."""

from layout_walk import walk


def test_nothing_is_cut_on_any_page_at_four_sizes(context):
    assert list(walk(context)) == []
