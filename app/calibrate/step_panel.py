"""The side panel of a step: task, help, one number, one cause, buttons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from PySide6.QtCore import QByteArray, QPoint, QSize, Qt, QTimer
from PySide6.QtGui import QPixmap
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import (
    QApplication,
    QFrame,
    QMenu,
    QProgressBar,
    QPushButton,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.widgets import theme
from app.widgets.actions import add_item
from app.widgets.icons import FOLDER, painted
from app.widgets.label import PlainLabel, escaped, plain_tip
from app.widgets.layout import hbox, scroll_area, vbox
from app.widgets.quality_table import QualityTableWidget
from app.widgets.status_icon import StatusIcon
from app.widgets.text_roles import named_label, set_background_role, set_property, set_text_role
from app.widgets.widget_names import set_names
from gelpolight_core.base.finding import QualityTable

from .page_state import (
    Capture,
    PageState,
    StepDeclaration,
    is_done,
    state_icon,
    state_meaning,
    state_word,
)

DRAWING = FOLDER / "drawings" / "assembly.svg"
BOX = QSize(288, 150)

SENSOR = "housing", "leds", "slab", "camera", "membrane"
ASSEMBLIES: dict[str, tuple[str, tuple[str, ...]]] = {
    "camera": (
        "The camera alone, with a checkerboard held in front of it",
        ("camera", "held_board"),
    ),
    "board": (
        "Housing without elastomer, checkerboard on the top opening, pattern facing down",
        ("housing", "camera", "board"),
    ),
    "mirror": (
        "Housing without elastomer, LEDs on, mirror on the top opening",
        ("housing", "leds", "camera", "mirror"),
    ),
    "whiteboard": (
        "Elastomer without membrane, white board pressed onto it",
        ("housing", "leds", "slab", "camera", "whiteboard"),
    ),
    "membrane": ("Elastomer with membrane, nothing touching it", SENSOR),
    "ball": ("A ball pressed into the membrane", (*SENSOR, "ball")),
    "indenter": ("An indenter of known size pressed into the membrane", (*SENSOR, "indenter")),
    "complete": ("The complete sensor: camera, LEDs, elastomer, membrane", SENSOR),
}
"""What each drawing shows, for a screen reader, and its parts."""
PARTS = {
    "housing": "",
    "camera": "camera",
    "leds": "LEDs",
    "slab": "elastomer",
    "board": "board",
    "held_board": "board, tilted",
    "mirror": "mirror",
    "whiteboard": "white board",
    "membrane": "membrane",
    "ball": "ball",
    "indenter": "indenter",
}
"""All parts with their labels."""


def drawing_of(assembly: str, label: QWidget) -> QPixmap:
    """Return the drawing of an assembly in the colours of the theme and the font of a label."""
    visibility = dict.fromkeys(PARTS, "none") | dict.fromkeys(ASSEMBLIES[assembly][1], "inline")
    labels = {f"{part}_word": escaped(word) for part, word in PARTS.items()}
    colours = {name: theme.colour(name).name() for name in ("text", "button", "muted", "accent")}
    svg = DRAWING.read_text("utf-8").format(
        **visibility, **labels, **colours, font=label.font().family()
    )
    drawing = QSvgRenderer(QByteArray(svg.encode()))
    drawing.setAspectRatioMode(Qt.AspectRatioMode.KeepAspectRatio)
    ratio = label.devicePixelRatioF()
    pixmap = painted(BOX * ratio, drawing.render)
    pixmap.setDevicePixelRatio(ratio)
    return pixmap


SHEET_WIDTH = 320


class StepHelp(QToolButton):
    """A button that shows the drawing of the set-up, with a button to the guide."""

    def __init__(self) -> None:
        super().__init__()
        set_names(self, "calibrate.help", "Help on this step", "How to set it up")
        self.setText("?")
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self._sheet = set_names(
            QFrame(self, Qt.WindowType.Popup), "calibrate.help.sheet", "Help on this step"
        )
        self._sheet.setFrameShape(QFrame.Shape.Box)
        self._sheet.setFixedWidth(SHEET_WIDTH)
        self._assembly = "complete"
        self._drawing = named_label("calibrate.assembly", "Help on this step", wrap=False)
        self._words = PlainLabel(wrap=True)
        self.guide = set_names(
            QPushButton("Read the &guide"), "calibrate.help.guide", "Read about this step"
        )
        vbox(self._drawing, self._words, self.guide, of=self._sheet, margins=16)
        self.guide.clicked.connect(self._sheet.close)
        self.clicked.connect(self._open)

    def show_step(self, step: StepDeclaration) -> None:
        """Show the set-up of another step."""
        self._assembly = step.assembly
        self._words.setText(step.advice)
        self._words.setVisible(bool(step.advice))

    def _open(self) -> None:
        description = ASSEMBLIES[self._assembly][0]
        set_names(self._drawing, "calibrate.assembly", description, description)
        self._drawing.setPixmap(drawing_of(self._assembly, self._drawing))
        corner = self.mapToGlobal(self.rect().bottomRight())
        self._sheet.adjustSize()
        self._sheet.move(corner - QPoint(SHEET_WIDTH, -4))
        self._sheet.show()


WIDTH = 304
# This space is always reserved, so that nothing moves when a message changes.
HINT_LINES = 4
NUMBER_LINES = 3
REMEDIES = 3
"""As many as the panel has room for."""
LEAST_CAPTURES = 2
"""With fewer captures there is nothing to compare."""


class StepPanel(QWidget):
    """The side panel of a step. The buttons of the lower part are always visible and never move.

    What comes and goes there is above them, and takes its space from the part that scrolls.
    """

    def __init__(self) -> None:
        super().__init__()
        set_names(self, "calibrate.panel", "This step")
        self.setFixedWidth(WIDTH)
        self._page = PageState()
        inside = QWidget()
        self._scroll = set_names(scroll_area(inside), "calibrate.panel.scroll", "This step")
        self._scroll.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._extra, self._below = QVBoxLayout(), QVBoxLayout()
        self.title = named_label("calibrate.title", "Step", wrap=False, bold=1.5)
        self.task = named_label("calibrate.task", "Task")
        self.help = StepHelp()
        vbox(
            hbox((self.title, 1), self.help, margins=0),
            self.task,
            self._build_number(),
            self._extra,
            self._build_message(),
            self._below,
            self._build_details(),
            None,
            of=inside,
            margins=(16, 16, 16, 8),
            spacing=12,
        )
        vbox((self._scroll, 1), self._build_foot(), of=self, margins=0, spacing=0)

    def _build_number(self) -> QFrame:
        self.caption = named_label("calibrate.number.caption", "Figure of this step")
        self.number = named_label("calibrate.number", "Its value", wrap=False, bold=1.6)
        self._sign = StatusIcon()
        self._word = named_label("calibrate.state", "State of the step", wrap=False, bold=1.0)
        self.below = named_label("calibrate.count", "Captures of this step")
        self.details = set_names(QToolButton(), "calibrate.details", "Figures of this step")
        self.details.setText("Details")
        self.details.setCheckable(True)
        texts = QWidget()
        texts.setFixedHeight(NUMBER_LINES * texts.fontMetrics().lineSpacing())
        vbox(self.caption, self.below, None, of=texts, margins=0, spacing=0)
        for label in (self.caption, self.below):
            set_text_role(label, "muted")
        return card(
            hbox((self.number, 1), self._sign, self._word, margins=0, spacing=4),
            texts,
            hbox(None, self.details, margins=0),
        )

    def _build_message(self) -> QFrame:
        """Return the card of messages. An action that failed comes before the step's state."""
        self.notice = set_names(_message(), "calibrate.notice", "Result of the last action")
        self.sentence = set_names(_message(), "calibrate.sentence", "Message about the step")
        self.buttons = [
            set_names(QPushButton(), f"calibrate.remedy{place}", "Remedy")
            for place in range(REMEDIES)
        ]
        for place, button in enumerate(self.buttons):
            button.clicked.connect(lambda _on=False, k=place: self._page.remedies[k][1]())
        self._message = card(self.notice, self.sentence, *self.buttons)
        return self._message

    def _build_details(self) -> QWidget:
        self.quality = QualityTableWidget(
            "calibrate.quality", "Quality figures of this step", narrow=True
        )
        self.residual = named_label("calibrate.residual", "Residual", wrap=False, bold=1.0)
        self.residuals = QualityTableWidget(
            "calibrate.residuals", "Captures, worst first", narrow=True
        )
        self.repeat = set_names(
            QPushButton("Repeat the &worst"),
            "calibrate.residuals.repeat",
            "Repeat the worst capture",
            "Exclude the capture with the largest residual, and capture a new one",
        )
        details = QWidget()
        vbox(self.quality, self.residual, self.residuals, self.repeat, of=details, margins=0)
        details.hide()
        self.details.toggled.connect(details.setVisible)
        return details

    def _build_foot(self) -> QWidget:
        self.lay = set_names(
            QPushButton("Place it on the virtual &bench"),
            "calibrate.lay",
            "Place the object for this step on the virtual bench",
            "After an automatic capture the next view or press follows, until you move the object",
        )
        self.lay.hide()
        self.live = named_label("calibrate.live", "Content of the live image")
        self.live.setFixedHeight(HINT_LINES * self.live.fontMetrics().lineSpacing())
        self.live.setAlignment(Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignBottom)
        self.progress = set_names(QProgressBar(), "calibrate.progress", "Progress")
        self.progress.setRange(0, 100)
        self.cancel = set_names(QToolButton(), "calibrate.stop", "Stop the work")
        self.cancel.setText("Stop")
        for widget in (self.progress, self.cancel):
            widget.setFixedHeight(28)
        self.capture, tip = QPushButton("&Capture"), "Capture this image"
        set_names(self.capture, "calibrate.capture", "Capture", tip, "C")
        self.more = set_names(
            QToolButton(popupMode=QToolButton.ToolButtonPopupMode.InstantPopup),
            "calibrate.more",
            "More about capturing",
            "Import image files, or switch automatic captures",
        )
        self.more.setText("…")
        menu = QMenu(self.more)
        self.import_files = add_item(menu, "calibrate.import", "&Import image files…", list)
        text = "&Capture automatically"
        self.automatic = add_item(menu, "calibrate.automatic", text, list, checkable=True)
        self.more.setMenu(menu)
        self.capturing = QWidget()
        row = hbox((self.capture, 1), self.more, margins=0, spacing=8)
        vbox(self.live, self.lay, row, of=self.capturing, margins=0, spacing=8)
        self.next = set_names(QPushButton("&Next step"), "calibrate.next", "Next step")
        for button in (self.capture, self.next):
            button.setFixedHeight(36)
        self.more.setFixedSize(56, 36)
        foot = QWidget()
        parts = hbox((self.progress, 1), self.cancel, margins=0), self.capturing, self.next
        self._foot = vbox(*parts, of=foot, margins=(16, 8, 16, 16), spacing=8)
        return foot

    def add_extra(self, text: str, field: QWidget, *, below: bool = False) -> QFrame:
        """Add the card of a value that a step needs, above or below the message about the step.

        The step shows and hides it.
        """
        caption = PlainLabel(text)
        set_text_role(caption, "muted")
        frame = card(caption, field)
        (self._below if below else self._extra).addWidget(frame)
        QWidget.setTabOrder(self.lay, field)
        frame.hide()
        return frame

    def add_foot(self, widget: QWidget) -> QWidget:
        """Add a step's own buttons above Next. The step shows and hides them."""
        self._foot.insertWidget(self._foot.count() - 1, widget)
        widget.hide()
        return widget

    # What is shown

    def show_page(self, page: PageState) -> None:
        """Show another state of the page."""
        before, self._page = self._page, page
        step, number = page.step, page.number
        if step is not before.step:
            self.title.setText(step.title)
            self.task.setText(step.task)
            self.help.show_step(step)
            self.capturing.setVisible(step.frames > 0)
            self.capture.setText(step.button or "&Capture")
            self.next.setVisible(bool(page.following))
            self._scroll.verticalScrollBar().setValue(0)
        # Without a figure there will be one, unless the step is complete without any.
        waits = "" if is_done(page.state) else "No result yet"
        self.caption.setText(waits if number is None else number.text)
        self.caption.setToolTip(plain_tip(self.caption.text()))
        self.number.setText(waits and "\u2013" if number is None else number.value_text)
        self.below.setText(page.below)
        self._sign.show_icon(state_icon(page.state))
        self._word.setText(state_word(page.state).capitalize())
        set_text_role(self._word, state_meaning(page.state))
        figures = tuple(figure for table in page.tables for figure in table.figures)
        self.quality.set_table(QualityTable(figures))
        self.quality.setVisible(bool(figures))
        self._show_residuals(page.worst_first)
        self._show_message()
        self._show_foot()
        if page.notice != before.notice and page.notice[0]:
            self.reveal_message()
        # Only if the focus is on the last pressed button: never interrupt a person who is typing.
        advance = page.finished and not before.finished
        if advance and QApplication.focusWidget() in (None, self.capture):
            self.next.setFocus()

    def _show_residuals(self, worst: Sequence[Capture]) -> None:
        """Show the residuals of captures, the worst first."""
        judged = [(c.path.stem, c.finding) for c in worst if c.finding is not None]
        self.residual.setText(judged[0][1].text if judged else "")
        self.residuals.set_table(QualityTable(tuple(replace(f, text=name) for name, f in judged)))
        for widget in (self.residual, self.residuals, self.repeat):
            widget.setVisible(len(judged) >= LEAST_CAPTURES)

    def _show_message(self) -> None:
        """Show what is wrong: an action that was not done, or else the state of the step."""
        page, (notice, role) = self._page, self._page.notice
        is_wrong = page.state in ("warn", "fail", "stale", "waiting") and page.sentence
        self.notice.setText(notice)
        self.notice.setVisible(bool(notice))
        self.sentence.setText(page.sentence)
        set_text_role(self.sentence, "pass" if page.state == "pass" else "")
        self.sentence.setVisible(bool(is_wrong or page.remedies) and not notice)
        texts = [text for text, _ in page.remedies[: len(self.buttons)]]
        for button, text in zip(self.buttons, (*texts, *[""] * REMEDIES), strict=False):
            button.setVisible(bool(text))
            button.setText(text)
        role = role if notice else page.state
        set_background_role(self._message, role if role in ("warn", "fail") else "")
        self._message.setVisible(bool(notice or is_wrong or texts))

    def _show_foot(self) -> None:
        """Show the message about the live image, the running work, and the next step."""
        page, (title, fraction) = self._page, self._page.work
        self.live.setText(page.live[0])
        self.live.setVisible(bool(page.live[0]))
        set_text_role(self.live, page.live[1])
        self.capture.setEnabled(page.camera)
        self.progress.setVisible(bool(title))
        self.cancel.setVisible(bool(title))
        self.progress.setFormat(f"{title}  %p %" if title else "")
        self.progress.setRange(0, 100 if fraction > 0.0 else 0)
        self.progress.setValue(round(100 * fraction))
        self.next.setText(f"&Next: {page.following}")
        set_property(self.next, "primary", page.finished)

    def reveal_message(self) -> None:
        """Scroll to what is wrong or comes next."""
        self.reveal(self._message)

    def reveal(self, widget: QWidget) -> None:
        """Scroll to a part of the panel, once it has its place."""
        QTimer.singleShot(0, self, partial(self._scroll.ensureWidgetVisible, widget))


def card(*parts: object) -> QFrame:
    """Return a card with parts from top to bottom."""
    frame = QFrame()
    frame.setObjectName("card")
    vbox(*parts, of=frame, margins=(12, 8, 12, 8), spacing=4)
    return frame


def _message() -> PlainLabel:
    label = PlainLabel(wrap=True)
    label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    return label
