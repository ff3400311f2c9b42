"""The state of a step or an image: text, colour and icon, the same everywhere in the wizard."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QIcon, QPainter, QPen, QPixmap

from app.calibrate.step_data import Step
from app.theme import theme
from gelpolight_core.calibration.status import StageState, StageStatus
from gelpolight_core.translation import tr

StepState = tuple[str, str]
"""State of a step, and the message about it."""

RUNNING = "running"
BEGUN = "begun"
SIZE = 18
_ORDER = ("pass", "warn", "stale", "waiting", "empty", "fail")


def state_word(state: str) -> str:
    """Return the text for a state."""
    return {
        "empty": tr("empty"),
        "waiting": tr("not computed"),
        BEGUN: tr("incomplete"),
        "stale": tr("outdated"),
        "running": tr("running"),
        "pass": tr("pass"),
        "warn": tr("warning"),
        "fail": tr("fail"),
    }[state]


def state_meaning(state: str) -> str:
    """Return the meaning of a state, from which the theme derives the colour."""
    names = {"empty": "muted", BEGUN: "muted", "waiting": "stale", "running": "accent"}
    return names.get(state, state)


def state_colour(state: str) -> QColor:
    """Return the colour of a state in the present theme."""
    return theme.colour(state_meaning(state))


def state_icon(state: str) -> QIcon:
    """Return an icon for a state; its shape shows the state without the colour."""
    sign = QIcon()
    back = theme.colour("base")
    sign.addPixmap(_draw(state, state_colour(state), back), QIcon.Mode.Normal)
    # On the highlighted row of a list.
    chosen, behind = theme.colour("highlighted"), theme.colour("highlight")
    sign.addPixmap(_draw(state, chosen, behind), QIcon.Mode.Selected)
    return sign


def _draw(state: str, colour: QColor, back: QColor) -> QPixmap:
    ratio = 2
    pixmap = QPixmap(SIZE * ratio, SIZE * ratio)
    pixmap.setDevicePixelRatio(ratio)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    _paint(painter, state, colour, back)
    painter.end()
    return pixmap


def _paint(painter: QPainter, state: str, colour: QColor, back: QColor) -> None:
    box = QRectF(2, 2, SIZE - 4, SIZE - 4)
    pen = QPen(colour, 1.8)
    pen.setCapStyle(Qt.PenCapStyle.RoundCap)
    painter.setPen(pen)
    if state == BEGUN:
        painter.drawArc(box, 0, 360 * 16)
        painter.setBrush(colour)
        painter.drawPie(box, 90 * 16, -180 * 16)
        return
    if state in ("empty", "waiting"):
        if state == "waiting":
            pen.setStyle(Qt.PenStyle.DotLine)
            painter.setPen(pen)
        painter.drawEllipse(box)
        return
    if state == "running":
        painter.drawArc(box, 90 * 16, -270 * 16)
        return
    painter.setBrush(colour)
    if state == "warn":
        painter.drawPolygon([QPointF(9, 2), QPointF(16.5, 15.5), QPointF(1.5, 15.5)])
    else:
        painter.drawEllipse(box)
    painter.setPen(QPen(back, 2.0))
    if state == "pass":
        painter.drawPolyline([QPointF(5.4, 9.4), QPointF(8.0, 12.0), QPointF(12.8, 6.4)])
    elif state == "fail":
        painter.drawLine(QPointF(6, 6), QPointF(12, 12))
        painter.drawLine(QPointF(12, 6), QPointF(6, 12))
    elif state == "stale":
        painter.drawPolyline([QPointF(9, 5), QPointF(9, 9.4), QPointF(12, 11)])
    elif state == "warn":
        painter.drawLine(QPointF(9, 6.5), QPointF(9, 10.5))
        painter.drawPoint(QPointF(9, 13.2))


def step_state(
    step: Step, statuses: Mapping[str, StageStatus], running: str | None, *, count: int
) -> StepState:
    """Return state and message of a step: those of its worst stage.

    A step with too few images, `count`, has not failed: it is still incomplete.
    """
    if not step.stages:
        return "empty", ""
    if running in step.stages:
        return RUNNING, tr("Computing")
    found = [statuses[stage] for stage in step.stages]
    worst = max(found, key=lambda status: _ORDER.index(status.state.value))
    if worst.state is StageState.FAIL and 0 < count < step.least:
        text = tr("{n} captured. At least {m} are needed, {w} are recommended.")
        return BEGUN, text.format(n=count, m=step.least, w=step.wanted)
    return worst.state.value, worst.sentence


OPEN = (StageState.EMPTY.value, BEGUN, StageState.FAIL.value)
"""States in which a step still needs the user."""


def is_done(state: str) -> bool:
    """Return whether a step in this state is complete."""
    return state in (StageState.PASS.value, StageState.WARN.value)
