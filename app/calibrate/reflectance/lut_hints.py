"""Usage hints of the curve editor."""

from __future__ import annotations

from gelpolight_core.translation import tr

HINT = tr(
    "Drag a node to move it, click it to select it, double-click the curve to add a node, use the "
    "wheel to zoom. A node stays between its neighbours; click Fewer nodes to get more room."
)
LASSO_HINT = tr("Draw a line around the points to exclude. Press Esc to leave the lasso.")


def node_hint(number: int, count: int, cosine: float, value: float) -> str:
    """Return the hint for the selected node.

    Parameters
    ----------
    number, count : int
        Number of the node, from 1, and number of nodes.
    cosine, value : float
        Position of the node.
    """
    return tr(
        "Node {number} of {all}: cosine {cosine:.4f}, value {value:.4f}. Arrow keys move it "
        "(Shift: ten times as far), Page Up and Page Down select its neighbours, Del removes it."
    ).format(number=number, all=count, cosine=cosine, value=value)
