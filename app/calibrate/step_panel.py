"""What to do in a step, how it stands, and the buttons for it."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QDoubleSpinBox,
    QFrame,
    QHBoxLayout,
    QLabel,
    QProgressBar,
    QPushButton,
    QScrollArea,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from app.calibrate.assembly import AssemblyPicture
from app.calibrate.states import state_colour, state_icon, state_word
from app.calibrate.steps import Step
from app.shell import theme
from app.widgets.naming import named
from app.widgets.quality_table import QualityTableWidget
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.quality import QualityTable
from gelpolight_core.translation import tr

WIDTH = 372


class StepPanel(QScrollArea):
    """The side panel of a step with pictures.

    Signals
    -------
    lay_wanted()
        Put on the virtual bench what this step asks for.
    capture_wanted()
        Take a picture now.
    import_wanted()
        Choose picture files.
    automatic_changed(bool)
        Take a picture by itself when it is still and good.
    next_wanted()
        Go to the next step.
    cancel_wanted()
        Stop the work that runs.
    recompute_wanted()
        Compute what is stale.
    """

    lay_wanted = Signal()
    capture_wanted = Signal()
    import_wanted = Signal()
    automatic_changed = Signal(bool)
    next_wanted = Signal()
    cancel_wanted = Signal()
    recompute_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        named(self, "calibrate.panel", tr("This step"))
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setMinimumWidth(WIDTH)
        self.setMaximumWidth(WIDTH + 60)
        inside = QWidget()
        inside.setMaximumWidth(WIDTH + 40)
        self.setWidget(inside)
        self._column = QVBoxLayout(inside)
        self._column.setContentsMargins(12, 10, 12, 10)
        self._column.setSpacing(8)
        self._build_head()
        self._build_capture()
        self._build_state()
        self._column.addStretch(1)
        self._build_foot()

    def _build_head(self) -> None:
        self.title = named(QLabel(), "calibrate.title", tr("Step"))
        font = self.title.font()
        font.setPointSizeF(font.pointSizeF() * 1.35)
        font.setBold(True)
        self.title.setFont(font)
        self.task = named(_wrapped(), "calibrate.task", tr("What to do"))
        self.assembly = AssemblyPicture()
        for widget in (self.title, self.assembly, self.task):
            self._column.addWidget(widget)

    def _build_capture(self) -> None:
        self.live = named(_wrapped(lines=3), "calibrate.live", tr("What the live picture shows"))
        self.live.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.radius_row = QWidget()
        row = QHBoxLayout(self.radius_row)
        row.setContentsMargins(0, 0, 0, 0)
        self.radius = named(
            QDoubleSpinBox(),
            "calibrate.radius",
            tr("Radius of the ball in mm"),
            tr("Of the next press, or of the one that is looked at"),
        )
        self.radius.setRange(0.05, 500.0)
        self.radius.setDecimals(3)
        self.radius.setSuffix(tr(" mm"))
        self.radius.setKeyboardTracking(False)
        row.addWidget(QLabel(tr("Ball radius")))
        row.addWidget(self.radius, 1)
        self.capture = named(
            QPushButton(tr("&Capture")),
            "calibrate.capture",
            tr("Capture"),
            tr("Take this picture (C)"),
        )
        self.capture.setMinimumHeight(38)
        self.capture.clicked.connect(self.capture_wanted)
        self.automatic = named(
            QCheckBox(tr("When still and &good")),
            "calibrate.automatic",
            tr("Capture by itself when the picture is still and good"),
        )
        self.automatic.toggled.connect(self.automatic_changed)
        self.import_files = named(
            QPushButton(tr("&Import…")), "calibrate.import", tr("Import picture files")
        )
        self.import_files.clicked.connect(self.import_wanted)
        buttons = QHBoxLayout()
        buttons.addWidget(self.capture, 2)
        buttons.addWidget(self.import_files, 1)
        self.capturing = QWidget()
        self.lay = lay_button("calibrate.lay")
        self.lay.clicked.connect(self.lay_wanted)
        column = QVBoxLayout(self.capturing)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.lay)
        column.addWidget(self.live)
        column.addWidget(self.radius_row)
        column.addLayout(buttons)
        column.addWidget(self.automatic)
        self._column.addWidget(self.capturing)

    def _build_state(self) -> None:
        row = QHBoxLayout()
        self._sign = QLabel()
        self._word = named(QLabel(), "calibrate.state", tr("State of the step"))
        font = self._word.font()
        font.setBold(True)
        self._word.setFont(font)
        self.recompute = named(
            QPushButton(tr("&Recompute")),
            "calibrate.recompute",
            tr("Recompute"),
            tr("Compute this step again from the captures that are stored"),
        )
        self.recompute.clicked.connect(self.recompute_wanted)
        row.addWidget(self._sign)
        row.addWidget(self._word, 1)
        row.addWidget(self.recompute)
        self.sentence = named(_wrapped(), "calibrate.sentence", tr("What to say of the step"))
        self.quality = QualityTableWidget(
            "calibrate.quality", tr("Quality figures of this step"), narrow=True
        )
        self._column.addLayout(row)
        self._column.addWidget(self.sentence)
        self._column.addWidget(self.quality)

    def _build_foot(self) -> None:
        row = QHBoxLayout()
        self.progress = named(QProgressBar(), "calibrate.progress", tr("Progress"))
        self.progress.setRange(0, 100)
        self.progress.setTextVisible(True)
        keep = self.progress.sizePolicy()
        keep.setRetainSizeWhenHidden(True)
        self.progress.setSizePolicy(keep)
        self.cancel = named(QPushButton(tr("Stop")), "calibrate.stop", tr("Stop the work"))
        keep = self.cancel.sizePolicy()
        keep.setRetainSizeWhenHidden(True)
        self.cancel.setSizePolicy(keep)
        self.cancel.clicked.connect(self.cancel_wanted)
        row.addWidget(self.progress, 1)
        row.addWidget(self.cancel)
        self._column.addLayout(row)
        self.next = named(QPushButton(tr("&Next step")), "calibrate.next", tr("Next step"))
        self.next.setMinimumHeight(34)
        self.next.clicked.connect(self.next_wanted)
        self._column.addWidget(self.next)
        self.show_work("", 0.0)

    def show_step(self, step: Step, *, last: bool) -> None:
        """Show another step's task."""
        self.title.setText(step.title)
        self.task.setText(step.task)
        self.assembly.show_assembly(step.assembly)
        self.capturing.setVisible(step.stage is not None and step.key != "refraction")
        self.radius_row.setVisible(step.stage is Stage.BALLS)
        self.next.setVisible(not last)
        self.verticalScrollBar().setValue(0)

    def show_live(self, sentence: str, *, ready: bool) -> None:
        """Say what the live picture shows."""
        self.live.setText(sentence)
        role = "pass" if ready else "warn"
        self.live.setStyleSheet(f"color: {theme.colour(role).name()};" if sentence else "")

    def show_state(
        self, state: str, sentence: str, quality: QualityTable, *, stale: bool, done: bool
    ) -> None:
        """Show how the step stands."""
        self._sign.setPixmap(state_icon(state).pixmap(18, 18))
        self._word.setText(state_word(state).capitalize())
        self._word.setStyleSheet(f"color: {state_colour(state).name()};")
        self.sentence.setText(sentence)
        self.quality.set_table(quality)
        self.quality.setVisible(bool(quality.figures))
        self.recompute.setVisible(stale)
        self.next.setDefault(done)
        weight = "font-weight: bold;" if done else ""
        self.next.setStyleSheet(weight)

    def show_work(self, title: str, share: float) -> None:
        """Show the work that runs; an empty title when there is none."""
        self.progress.setVisible(bool(title))
        self.cancel.setVisible(bool(title))
        self.progress.setFormat(f"{title}  %p %" if title else "")
        self.progress.setRange(0, 100 if share > 0.0 else 0)
        self.progress.setValue(round(100 * share))


def lay_button(name: str) -> QPushButton:
    """Return the button of the virtual bench; hidden where the camera is a real one."""
    button = named(
        QPushButton(tr("Put it on the &virtual bench")),
        name,
        tr("Put on the virtual bench what this step asks for"),
        tr("Each time the next view or press, as a technician would arrange it"),
    )
    button.hide()
    return button


def _wrapped(*, lines: int = 0) -> QLabel:
    label = QLabel()
    label.setWordWrap(True)
    label.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Minimum)
    label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    if lines:
        label.setMinimumHeight(lines * label.fontMetrics().lineSpacing() + 4)
    return label
