"""A window with the guide, which is part of every installation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import QDesktopServices, QImage, QTextCursor, QTextDocument
from PySide6.QtWidgets import QDialog, QListWidget, QListWidgetItem, QTextBrowser, QWidget

from app.widgets.buttons import push_button
from app.widgets.layout import hbox, splitter, vbox
from app.widgets.naming import named

# In the order in which they are read.
PAGES = (
    ("index", "Overview"),
    ("guide/first-start", "First start"),
    ("guide/what-you-need", "What you need"),
    ("guide/cameras", "Cameras"),
    ("guide/calibrate", "Calibrate"),
    ("guide/validate", "Validate"),
    ("guide/inspect", "Inspect"),
    ("guide/measure", "Measure"),
    ("guide/keeping-it-true", "Routine checks"),
    ("guide/closed-sensors", "Closed sensors"),
    ("reference/quality-figures", "Quality figures"),
    ("reference/health", "Faults of an image"),
    ("guide/troubleshooting", "Troubleshooting"),
)
# Guide page for each page of the program.
OF_PAGE = {
    "start": "guide/first-start",
    "sensors": "guide/validate",
    "calibrate": "guide/calibrate",
    "inspect": "guide/inspect",
    "measure": "guide/measure",
}


Unknown = QTextDocument.ResourceType.UnknownResource


class GuideText(QTextBrowser):
    """Shows a Markdown page. Its images are not wider than the window."""

    def loadResource(self, kind: int, name: QUrl | str) -> Any:
        """Return a page or a scaled image."""
        name = QUrl(name)
        if kind == QTextDocument.ResourceType.ImageResource.value:
            image = QImage(self.source().resolved(name).toLocalFile())
            width = max(self.viewport().width() - 40, 200)
            if image.width() > width:
                image = image.scaledToWidth(width, Qt.TransformationMode.SmoothTransformation)
            return image
        return super().loadResource(kind, name)

    def doSetSource(self, name: QUrl | str, /, type: Any = Unknown) -> None:
        """Show a page of the guide. Anything else is shown by the web browser."""
        name = QUrl(name)
        if not name.isLocalFile() and not name.isRelative():
            QDesktopServices.openUrl(name)
            return
        super().doSetSource(name, type)

    def show_heading(self, words: str) -> bool:
        """Scroll to the first heading that contains some words. Return whether there is one."""
        block = self.document().begin()
        while block.isValid():
            if block.blockFormat().headingLevel() and words.casefold() in block.text().casefold():
                cursor = QTextCursor(block)
                self.setTextCursor(cursor)
                top = self.document().documentLayout().blockBoundingRect(block).top()
                self.verticalScrollBar().setValue(round(top))
                return True
            block = block.next()
        return False


class GuideWindow(QDialog):
    """The guide, with a list of its pages.

    Parameters
    ----------
    folder : Path
        The folder with the Markdown pages.
    parent : QWidget, optional
        The main window.
    """

    def __init__(self, folder: Path, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        named(self, "guide", "Guide")
        self.setWindowTitle("Guide")
        self.resize(980, 720)
        self._folder = folder
        self.list = named(QListWidget(self), "guide.pages", "Pages of the guide")
        for name, title in PAGES:
            if self._path(name).is_file():
                item = QListWidgetItem(title)
                item.setData(Qt.ItemDataRole.UserRole, name)
                self.list.addItem(item)
        self.list.setMaximumWidth(220)
        self.list.itemClicked.connect(lambda i: self.show_page(i.data(Qt.ItemDataRole.UserRole)))
        self.list.itemActivated.connect(lambda i: self.show_page(i.data(Qt.ItemDataRole.UserRole)))
        self.text = named(GuideText(self), "guide.text", "Guide")
        self.text.setOpenExternalLinks(False)
        back = push_button("guide.back", "Back", self.text.backward)
        back.setEnabled(False)
        back.setAutoDefault(False)
        self.text.backwardAvailable.connect(back.setEnabled)
        split = splitter(Qt.Orientation.Horizontal, (self.list, 0), (self.text, 1))
        vbox(hbox(back, None), (split, 1), of=self)

    def show_page(self, name: str, heading: str = "") -> None:
        """Show a page, at a heading if one is given."""
        self.text.setSource(QUrl.fromLocalFile(str(self._path(name))))
        for row in range(self.list.count()):
            if self.list.item(row).data(Qt.ItemDataRole.UserRole) == name:
                self.list.setCurrentRow(row)
        if heading:
            self.text.show_heading(heading)

    def _path(self, name: str) -> Path:
        return self._folder / f"{name}.md"
