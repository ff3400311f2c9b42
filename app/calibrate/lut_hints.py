"""What the curve editor says of how to edit."""

from __future__ import annotations

from gelpolight_core.translation import tr

HINT = tr(
    "Drag a ring to move it; click one to choose it; double-click the curve for a new one; the "
    "wheel zooms. A ring stays between its neighbours: Fewer nodes gives room."
)
LASSO_HINT = tr("Drag a line around the points to leave out. Esc puts the lasso away.")


def node_hint(number: int, count: int, cosine: float, value: float) -> str:
    """Return what can be done with the node that is chosen.

    Parameters
    ----------
    number, count : int
        Which, from 1, of how many.
    cosine, value : float
        Where it is.
    """
    return tr(
        "Node {number} of {all}: cosine {cosine:.4f}, value {value:.4f}. Arrow keys nudge it "
        "(Shift: ten times), Page Up and Page Down choose its neighbours, Del removes it."
    ).format(number=number, all=count, cosine=cosine, value=value)
