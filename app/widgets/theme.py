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
# Signs that a style sheet draws, in a grey that can be seen on light and on dark.
SIGNS = ("check", "more-bar", "arrow-down", "arrow-up")
TEXT_PT = 9.75  # 13 px at 96 dots per inch

# name: (light, dark). Every text colour has at least 4.5:1 on window, base and alternate base.
COLOURS = {
    "window": ("#f5f6f8", "#1b1e24"),
    "base": ("#ffffff", "#15171c"),
    "alternate": ("#eceef2", "#1f232a"),
    "button": ("#e6e9ee", "#262b33"),
    "hover": ("#d9dee5", "#313740"),
    "text": ("#1b2026", "#e7e9ec"),
    "muted": ("#565f69", "#9da5af"),
    "disabled": ("#868e97", "#767e87"),
    "line": ("#d5dae0", "#2d323b"),
    "light": ("#ffffff", "#2d323b"),
    "highlight": ("#1a63c5", "#2a6fd0"),
    "highlighted": ("#ffffff", "#ffffff"),
    "bar": ("#a9c8f0", "#1f4a80"),
    "accent": ("#1259b8", "#78b4f8"),
    "pass": ("#17652f", "#5fce84"),
    "warn": ("#7f4d00", "#f2b75f"),
    "fail": ("#ad1f18", "#ff938a"),
    "stale": ("#5f4596", "#bfa9e8"),
    "tip": ("#fffbe8", "#2d323b"),
    "pass ground": ("#dff3e5", "#14301d"),
    "warn ground": ("#fcefd8", "#392a10"),
    "fail ground": ("#fbe1df", "#43191a"),
}

# Colours that mark the meaning of a text.
MEANINGS = ("pass", "warn", "fail", "stale", "accent", "muted")
GROUNDS = ("pass", "warn", "fail")

STYLE = """
QToolTip {{ color: {text}; background: {tip}; border: 1px solid {line}; padding: 4px; }}
QMenuBar {{ background: {window}; }}
QToolBar {{ background: {window}; border: none; padding: 4px 8px; spacing: 8px; }}
QToolBar#state {{ border-bottom: 1px solid {line}; }}
QToolBar#state QToolButton, QLabel#chip {{ background: {button}; border: 1px solid transparent;
    border-radius: 14px; padding: 5px 12px; }}
QToolBar#state QToolButton:hover {{ background: {hover}; }}
QToolBar#state QToolButton:focus {{ border-color: {accent}; }}
QToolBar#state QToolButton[popupMode="2"] {{ padding-right: 24px; }}
QToolBar#navigation {{ background: {window}; border: none; border-right: 1px solid {line}; }}
QToolBar#navigation QToolButton {{ border: 1px solid transparent; border-radius: 8px;
    padding: 8px 2px; min-width: 70px; background: transparent; color: {muted}; }}
QToolBar#navigation QToolButton:hover {{ background: {button}; }}
QToolBar#navigation QToolButton:checked {{ background: {hover}; color: {text};
    font-weight: 600; }}
QToolBar#navigation QToolButton:focus {{ border-color: {accent}; }}
QPushButton {{ border: 1px solid transparent; border-radius: 6px; padding: 6px 10px;
    background: {button}; color: {text}; }}
QPushButton:hover {{ background: {hover}; }}
QPushButton:pressed, QPushButton:checked {{ background: {line}; }}
QPushButton:focus {{ border-color: {accent}; }}
QPushButton:default, QPushButton[primary="true"] {{ background: {highlight};
    color: {highlighted}; font-weight: 600; }}
QPushButton:default:focus, QPushButton[primary="true"]:focus {{ border-color: {text}; }}
QPushButton:disabled {{ background: {alternate}; color: {disabled}; }}
QToolButton {{ border: 1px solid transparent; border-radius: 6px; padding: 4px 6px;
    background: {button}; }}
QToolBar QToolButton, QToolButton[autoRaise="true"] {{ background: transparent; }}
QToolButton:hover {{ background: {hover}; }}
QToolButton:pressed {{ background: {line}; }}
QToolButton:checked {{ background: {highlight}; color: {highlighted}; }}
QToolButton:disabled {{ color: {disabled}; }}
QToolButton#qt_toolbar_ext_button {{ padding: 0; background: {button};
    qproperty-icon: url("{more-bar}"); }}
QToolButton[fold="true"] {{ text-align: left; padding: 4px 0; color: {text};
    background: transparent; }}
QToolButton:focus {{ border-color: {accent}; }}
QToolButton[popupMode="2"] {{ padding-right: 22px; }}
QToolButton::menu-indicator {{ image: url("{arrow-down}"); width: 10px; height: 10px;
    subcontrol-origin: padding; subcontrol-position: center right; right: 8px; }}
QLineEdit, QAbstractSpinBox, QComboBox, QPlainTextEdit {{ background: {base}; color: {text};
    border: 1px solid {line}; border-radius: 6px; padding: 3px 4px;
    selection-background-color: {highlight}; selection-color: {highlighted}; }}
QLineEdit:focus, QAbstractSpinBox:focus, QComboBox:focus, QPlainTextEdit:focus {{
    border-color: {accent}; }}
QAbstractSpinBox[refused="true"] {{ border-color: {fail}; color: {fail}; }}
QLineEdit:disabled, QAbstractSpinBox:disabled, QComboBox:disabled {{ background: {window};
    color: {disabled}; }}
QAbstractSpinBox {{ padding-right: 18px; }}
QAbstractSpinBox QLineEdit {{ border: none; padding: 0; background: transparent; }}
QAbstractSpinBox::up-button, QAbstractSpinBox::down-button {{ border: none; width: 18px;
    background: transparent; }}
QAbstractSpinBox::up-arrow {{ image: url("{arrow-up}"); width: 9px; height: 9px; }}
QAbstractSpinBox::down-arrow {{ image: url("{arrow-down}"); width: 9px; height: 9px; }}
QComboBox::drop-down {{ border: none; width: 22px; }}
QComboBox::down-arrow {{ image: url("{arrow-down}"); width: 10px; height: 10px; }}
QComboBox QAbstractItemView {{ background: {base}; border: 1px solid {line};
    selection-background-color: {highlight}; selection-color: {highlighted}; }}
QGroupBox {{ border: none; margin-top: 22px; padding: 0; }}
QGroupBox::title {{ subcontrol-origin: margin; subcontrol-position: top left; color: {muted}; }}
QFrame#card {{ background: {alternate}; border: 1px solid {line}; border-radius: 8px; }}
QListWidget[plain="true"] {{ background: transparent; border: none; outline: none; }}
QListWidget[plain="true"]::item {{ border-radius: 6px; padding-left: 6px; color: {text}; }}
QListWidget[plain="true"]::item:hover {{ background: {button}; }}
QListWidget[plain="true"]::item:selected {{ background: {hover}; }}
QWidget[ground="image"] > * {{ background: {window}; color: {text}; }}
QWidget[ground="image"] > QToolButton:hover {{ background: {hover}; }}
QWidget[ground="image"] > QToolButton:checked {{ background: {hover}; color: {text}; }}
QTabWidget::pane {{ border: none; }}
QTabBar::tab {{ background: transparent; border: none; color: {muted}; padding: 8px 14px;
    border-bottom: 2px solid transparent; }}
QTabBar::tab:selected {{ color: {text}; border-bottom-color: {highlight}; }}
QTabBar::tab:hover {{ color: {text}; }}
QTabBar::tab:focus {{ border-bottom-color: {accent}; }}
QAbstractItemView {{ background: {base}; border: 1px solid {line}; border-radius: 6px;
    gridline-color: {line}; }}
QHeaderView::section {{ background: {window}; color: {muted}; border: none;
    border-bottom: 1px solid {line}; padding: 6px 8px; }}
QSplitter::handle {{ background: {line}; }}
QSplitter::handle:horizontal {{ width: 1px; margin: 0 2px; }}
QSplitter::handle:vertical {{ height: 1px; margin: 2px 0; }}
QScrollBar {{ background: transparent; border: none; }}
QScrollBar:vertical {{ width: 10px; }}
QScrollBar:horizontal {{ height: 10px; }}
QScrollBar::handle {{ background: {hover}; border-radius: 4px; min-height: 24px; min-width: 24px;
    margin: 1px; }}
QScrollBar::handle:hover {{ background: {muted}; }}
QScrollBar::add-line, QScrollBar::sub-line {{ width: 0; height: 0; }}
QScrollBar::add-page, QScrollBar::sub-page {{ background: transparent; }}
QProgressBar {{ background: {button}; border: none; border-radius: 4px; text-align: center; }}
QProgressBar::chunk {{ background: {bar}; border-radius: 4px; }}
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
    values = {name: pair[dark] for name, pair in COLOURS.items()}
    rules = [STYLE.format(**values, **{sign: (ICONS / f"{sign}.svg").as_posix() for sign in SIGNS})]
    for name in MEANINGS:
        rules.append(f'QLabel[meaning="{name}"] {{ color: {values[name]}; }}')
    for name in GROUNDS:
        rules.append(
            f'QWidget[ground="{name}"] {{ background: {values[name + " ground"]};'
            f" color: {values[name]}; }}"
        )
    return "\n".join(rules)


def apply(application: QApplication, choice: str) -> None:
    """Apply a theme: ``light``, ``dark``, or ``system`` for the theme of the desktop."""
    if choice == "system":
        dark = QGuiApplication.styleHints().colorScheme() == Qt.ColorScheme.Dark
    else:
        dark = choice == "dark"
    with _no_widget_vanishes():
        if application.style().name() != "fusion":
            application.setStyle("Fusion")
        application.setPalette(palette_for(dark))
        font = application.font()
        font.setPointSizeF(TEXT_PT)
        application.setFont(font)
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
