"""Light and dark theme: palettes, named colours, and style rules that Fusion needs."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QGuiApplication, QPalette
from PySide6.QtWidgets import QApplication

ICONS = Path(__file__).resolve().parents[2] / "resources" / "icons"
CHECK = ICONS / "check.svg"
# In a grey that can be seen on light and on dark.
MORE = ICONS / "more-bar.svg"

# name: (light, dark). Every text colour has at least 4.5:1 on window, base and alternate base.
COLOURS = {
    "window": ("#f3f4f6", "#212429"),
    "base": ("#ffffff", "#191b1f"),
    "alternate": ("#eceef1", "#23262b"),
    "button": ("#e6e8ec", "#30353b"),
    "text": ("#1b2026", "#e7e9ec"),
    "muted": ("#565f69", "#a6aeb8"),
    "disabled": ("#868e97", "#767e87"),
    "line": ("#c9ced4", "#3d434b"),
    "light": ("#ffffff", "#3d434b"),
    "highlight": ("#0b5cad", "#1f62a8"),
    "highlighted": ("#ffffff", "#ffffff"),
    "accent": ("#0b5cad", "#74b5f7"),
    "pass": ("#17652f", "#74d18f"),
    "warn": ("#7f4d00", "#f2b75f"),
    "fail": ("#ad1f18", "#ff938a"),
    "stale": ("#5f4596", "#bfa9e8"),
    "tip": ("#fffbe8", "#33383f"),
}

# Colours that mark the meaning of a text.
MEANINGS = ("pass", "warn", "fail", "stale", "accent", "muted")

STYLE = """
QToolTip {{ color: {text}; background: {tip}; border: 1px solid {line}; padding: 3px; }}
QStatusBar {{ border-top: 1px solid {line}; }}
QStatusBar::item {{ border: none; }}
QStatusBar QLabel {{ padding: 1px 8px; }}
QToolBar#navigation {{ background: {alternate}; border: none; border-right: 1px solid {line};
    padding: 6px; spacing: 4px; }}
QToolBar#navigation QToolButton {{ border: 2px solid transparent; border-radius: 6px;
    padding: 8px 4px; min-width: 76px; background: transparent; }}
QToolBar#navigation QToolButton:hover {{ background: {button}; }}
QToolBar#navigation QToolButton:checked {{ background: {base}; border-color: {line};
    font-weight: 600; }}
QToolBar#navigation QToolButton:focus {{ border-color: {accent}; }}
QToolButton {{ border: 1px solid {line}; border-radius: 4px; padding: 4px 5px;
    background: {button}; }}
QToolBar QToolButton, QToolButton[autoRaise="true"] {{ background: transparent;
    border-color: transparent; }}
QToolButton:hover {{ background: {alternate}; border-color: {line}; }}
QToolButton:pressed, QToolButton:checked {{ background: {line}; }}
QToolButton:disabled {{ color: {disabled}; }}
QToolButton#qt_toolbar_ext_button {{ padding: 0; border: 1px solid {line};
    background: {button}; qproperty-icon: url("{more}"); }}
QToolButton:focus {{ border: 2px solid {accent}; padding: 3px 4px; }}
QToolButton[popupMode="2"] {{ padding-right: 18px; }}
QToolButton[popupMode="2"]:focus {{ padding-right: 17px; }}
QToolButton::menu-indicator {{ subcontrol-origin: padding; subcontrol-position: center right;
    right: 4px; }}
QCheckBox::indicator, QGroupBox::indicator, QAbstractItemView::indicator {{
    width: 14px; height: 14px; border: 1px solid {muted}; border-radius: 3px; background: {base}; }}
QCheckBox::indicator:hover, QCheckBox::indicator:focus, QGroupBox::indicator:hover {{
    border-color: {accent}; }}
QCheckBox::indicator:checked, QGroupBox::indicator:checked, QAbstractItemView::indicator:checked {{
    background: {highlight}; border-color: {highlight}; image: url("{check}"); }}
QCheckBox::indicator:disabled, QGroupBox::indicator:disabled {{
    border-color: {disabled}; background: {window}; }}
QCheckBox::indicator:checked:disabled {{ background: {disabled}; }}
QDialogButtonBox {{ dialogbuttonbox-buttons-have-icons: 0; }}
"""


def is_dark() -> bool:
    """Whether the program shows its dark theme now."""
    return QApplication.palette().color(QPalette.ColorRole.Window).lightness() < 128


def colour(name: str) -> QColor:
    """Return a colour of the current theme.

    Parameters
    ----------
    name : str
        A key of COLOURS. Those with a meaning are pass, warn, fail, stale, accent and muted.
    """
    return QColor(COLOURS[name][is_dark()])


def palette_for(dark: bool) -> QPalette:
    """Return the palette of a theme."""
    c = {name: QColor(pair[dark]) for name, pair in COLOURS.items()}
    role = QPalette.ColorRole
    palette = QPalette()
    for to, name in (
        (role.Window, "window"),
        (role.WindowText, "text"),
        (role.Base, "base"),
        (role.AlternateBase, "alternate"),
        (role.Text, "text"),
        (role.PlaceholderText, "muted"),
        (role.Button, "button"),
        (role.ButtonText, "text"),
        (role.BrightText, "fail"),
        (role.ToolTipBase, "tip"),
        (role.ToolTipText, "text"),
        (role.Highlight, "highlight"),
        (role.HighlightedText, "highlighted"),
        (role.Accent, "accent"),
        (role.Link, "accent"),
        (role.LinkVisited, "stale"),
        (role.Mid, "line"),
        (role.Light, "light"),
        (role.Midlight, "button"),
    ):
        palette.setColor(to, c[name])
    for to in (role.WindowText, role.Text, role.ButtonText, role.HighlightedText):
        palette.setColor(QPalette.ColorGroup.Disabled, to, c["disabled"])
    palette.setColor(QPalette.ColorGroup.Disabled, role.Highlight, c["button"])
    return palette


def style_sheet(dark: bool) -> str:
    """Return style rules that a palette cannot give Fusion, such as the frame of a check box."""
    colours = {name: pair[dark] for name, pair in COLOURS.items()}
    meanings = [f'QLabel[meaning="{name}"] {{ color: {colours[name]}; }}' for name in MEANINGS]
    rules = STYLE.format(**colours, check=CHECK.as_posix(), more=MORE.as_posix())
    return "\n".join([rules, *meanings])


def apply(application: QApplication, choice: str) -> None:
    """Apply a theme: ``light``, ``dark``, or ``system`` for that of the desktop."""
    if choice == "system":
        dark = QGuiApplication.styleHints().colorScheme() == Qt.ColorScheme.Dark
    else:
        dark = choice == "dark"
    with _no_widget_vanishes():
        if application.style().name() != "fusion":
            application.setStyle("Fusion")
        application.setPalette(palette_for(dark))
        application.setStyleSheet(style_sheet(dark))


@contextmanager
def _no_widget_vanishes() -> Iterator[None]:
    """Collect garbage now, and none inside the block.

    Qt walks through a list of all widgets to announce the new style. Handlers of the other widgets
    could then trigger the collection of a garbage widget, such as a menu that only refers to
    itself, and Qt would access deleted memory.
    """
    gc.collect()
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def contrast(one: QColor, other: QColor) -> float:
    """Return the contrast of two colours by WCAG 2, from 1 to 21."""

    def luminance(c: QColor) -> float:
        def linear(v: float) -> float:
            return v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4

        return 0.2126 * linear(c.redF()) + 0.7152 * linear(c.greenF()) + 0.0722 * linear(c.blueF())

    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)
