"""How a step or a picture stands: word, colour and sign, the same everywhere in the wizard."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QIcon, QPainter, QPen, QPixmap

from app.calibrate.steps import Step
from app.shell import theme
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.status import StageState, StageStatus
from gelpolight_core.translation import tr

RUNNING = "running"
BEGUN = "begun"
SIZE = 18
_ORDER = ("pass", "warn", "stale", "waiting", "empty", "fail")


def state_word(state: str) -> str:
    """Return the word for a state."""
    return {
        "empty": tr("empty"),
        "waiting": tr("not computed"),
        BEGUN: tr("begun"),
        "stale": tr("stale"),
        "running": tr("running"),
        "pass": tr("pass"),
        "warn": tr("warning"),
        "fail": tr("fail"),
    }[state]


def state_meaning(state: str) -> str:
    """Return the meaning for a state, by which the theme colours it."""
    names = {"empty": "muted", BEGUN: "muted", "waiting": "stale", "running": "accent"}
    return names.get(state, state)


def state_colour(state: str) -> QColor:
    """Return the colour for a state, in the theme of now."""
    return theme.colour(state_meaning(state))


def state_icon(state: str) -> QIcon:
    """Return a sign for a state: its shape tells it without the colour."""
    sign = QIcon()
    back = theme.colour("base")
    sign.addPixmap(_picture(state, state_colour(state), back), QIcon.Mode.Normal)
    # On the highlighted row of a list.
    chosen, behind = theme.colour("highlighted"), theme.colour("highlight")
    sign.addPixmap(_picture(state, chosen, behind), QIcon.Mode.Selected)
    return sign


def _picture(state: str, colour: QColor, back: QColor) -> QPixmap:
    ratio = 2
    picture = QPixmap(SIZE * ratio, SIZE * ratio)
    picture.setDevicePixelRatio(ratio)
    picture.fill(Qt.GlobalColor.transparent)
    painter = QPainter(picture)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    _paint(painter, state, colour, back)
    painter.end()
    return picture


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
    step: Step, statuses: Mapping[Stage, StageStatus], running: Stage | None, *, taken: int
) -> tuple[str, str]:
    """Return the state of a step and what to say of it: those of its worst stage.

    One with too few pictures, `taken`, has not failed: the person is still at it.
    """
    if not step.stages:
        return "empty", ""
    if running in step.stages:
        return RUNNING, tr("Computing")
    found = [statuses[stage] for stage in step.stages]
    worst = max(found, key=lambda status: _ORDER.index(status.state.value))
    if worst.state is StageState.FAIL and 0 < taken < step.least:
        said = tr("{n} taken; at least {m} are needed, {w} are better")
        return BEGUN, said.format(n=taken, m=step.least, w=step.wanted)
    return worst.state.value, worst.sentence


def is_done(state: str) -> bool:
    """Whether a step in this state needs nothing more."""
    return state in (StageState.PASS.value, StageState.WARN.value)
