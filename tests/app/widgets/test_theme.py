"""Texts are readable in both themes, and icons follow the theme."""

import os
import subprocess
import sys
from itertools import product
from pathlib import Path

import pytest
from PySide6.QtGui import QColor

from app.widgets import theme
from app.widgets.icons import FOLDER, icon

ROOT = Path(__file__).resolve().parents[3]
READABLE = 4.5  # WCAG 2, level AA, for normal text
TEXTS = ("text", "muted", "accent", "pass", "warn", "fail", "stale")
GROUNDS = ("window", "base", "alternate")


def contrast(one: QColor, other: QColor) -> float:
    """Return the contrast of two colours by WCAG 2, from 1 to 21."""

    def luminance(c: QColor) -> float:
        def linear(v: float) -> float:
            return v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4

        return 0.2126 * linear(c.redF()) + 0.7152 * linear(c.greenF()) + 0.0722 * linear(c.blueF())

    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def pair(one: str, other: str, dark: bool) -> float:
    return contrast(QColor(theme.COLOURS[one][dark]), QColor(theme.COLOURS[other][dark]))


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_every_text_is_readable_on_every_background(dark):
    pairs = [*product(TEXTS, GROUNDS), *(("text", ground) for ground in ("button", "tip"))]
    weak = {one: pair(*one, dark) for one in (*pairs, ("highlighted", "highlight"))}
    assert {one: found for one, found in weak.items() if found < READABLE} == {}


@pytest.fixture
def light_again(qapp):
    yield
    theme.apply(qapp, "light")


def test_an_icon_made_before_follows_the_theme(qapp, light_again):
    drawn = icon("pass", "pass")

    def darkest() -> int:
        image = drawn.pixmap(32, 32).toImage()
        inked = [image.pixelColor(x, y) for x in range(32) for y in range(32)]
        return min(c.lightness() for c in inked if c.alpha() > 200)

    light = darkest()
    theme.apply(qapp, "dark")
    assert darkest() > light + 50
    assert theme.is_dark() and theme.colour("pass") == QColor(theme.COLOURS["pass"][True])


CHANGING = """
import gc
from PySide6.QtGui import QIcon, QPixmap
from app.window.desktop import make_application
from app.widgets.icons import icon

application = make_application()
kept = []
for number in range(200):
    first = icon("info", "warn")
    second = QIcon(first)
    second.addPixmap(QPixmap(4, 4))
    del first
    gc.collect(0)
    assert not second.pixmap(16, 16).isNull()
    if number % 2:
        kept.append(second)
"""


def test_icons_that_qt_copies_live_as_long_as_it_needs_them():
    """Also at program exit."""
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    done = subprocess.run(
        [sys.executable, "-c", CHANGING], cwd=ROOT, capture_output=True, text=True, timeout=600,
        env=environment,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_every_icon_draws_something(qapp):
    for path in FOLDER.glob("*.svg"):
        image = icon(path.stem).pixmap(24, 24).toImage()
        assert any(image.pixelColor(x, y).alpha() for x in range(24) for y in range(24)), path


SWITCHING = """
import gc
from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QMenu, QWidget
from app.window.desktop import make_application
from app.widgets import theme

class Busy(QWidget):
    def changeEvent(self, event):
        super().changeEvent(event)
        if event.type() == QEvent.Type.StyleChange:
            self.made = [[{}] for _ in range(2000)]  # enough for a collection

application = make_application()
shown = [Busy() for _ in range(20)]
for widget in shown:
    widget.show()
for number in range(20):
    gc.disable()
    for _ in range(20):
        menu = QMenu()
        menu.itself = menu
    del menu
    gc.enable()
    gc.set_threshold(700, 1, 1)
    theme.apply(application, ("dark", "light")[number % 2])
assert gc.isenabled()
"""


def test_switching_survives_widgets_that_are_garbage():
    done = subprocess.run(
        [sys.executable, "-c", SWITCHING], cwd=ROOT, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr
