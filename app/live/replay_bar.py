"""Playback controls of a recording or a folder of images: play, step, seek, loop, speed."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Qt
from PySide6.QtWidgets import QCheckBox, QWidget

from app.sources.player import Playback, Player
from app.sources.source import SourceFrame
from app.widgets.actions import Slot, icon_button, make_action
from app.widgets.inputs import ComboBox, Slider
from app.widgets.layout import hbox, vbox
from app.widgets.text_roles import named_label
from app.widgets.timers import timer
from app.widgets.widget_names import set_names


class ReplayBar(QWidget):
    """Controls the playback of a recording or a folder of images. Hidden if there is none.

    Parameters
    ----------
    page : str
        First part of its object name.
    on_moved : callable, optional
        Called when the user moved to another image or started playing.
    """

    def __init__(self, page: str, on_moved: Slot = lambda: None) -> None:
        super().__init__()
        set_names(self, f"{page}.replay", "Replay")
        self._moved = on_moved
        self._source: Player | None = None
        self._resumes = False
        row = hbox(of=self, margins=(8, 2, 8, 2))
        for name, text, slot, keys, icon_name in (
            ("back", "Previous image", lambda: self.step(-1), ",", "step-back"),
            ("play", "Play or pause", self._toggle, "Ctrl+Space", "play"),
            ("on", "Next image", lambda: self.step(1), ".", "step-on"),
        ):
            action = make_action(
                self, f"replay.{name}", text, slot, keys=(keys,), icon_name=icon_name
            )
            button = icon_button(action)
            button.setAutoRaise(True)
            row.addWidget(button)
            if name == "play":
                action.setCheckable(True)
                self._play = action
        self._slider = set_names(
            Slider(Qt.Orientation.Horizontal), f"{page}.replay.seek", "Position"
        )
        self._slider.valueChanged.connect(self._seek)
        self._words = named_label(f"{page}.replay.words", "Current position", wrap=False)
        row.addLayout(vbox(self._words, self._slider, spacing=0), 1)
        self._loop = set_names(QCheckBox("Loop"), f"{page}.replay.loop", "Start again at the end")
        self._loop.toggled.connect(lambda on: self._source and self._source.set_loop(on))
        self._speed = set_names(ComboBox(), f"{page}.replay.speed", "Speed")
        self._speed.offer((f"{speed:g} x", speed) for speed in (0.1, 0.25, 0.5, 1.0, 2.0, 4.0))
        self._speed.activated.connect(self._set_speed)
        row.addWidget(self._loop)
        row.addWidget(self._speed)
        self._timer = timer(self, 100, self._poll)
        self.hide()

    def follow(self, source: object) -> None:
        """Follow a source. The bar is hidden unless its images are stored."""
        self._source = source if isinstance(source, Player) else None
        self.setVisible(self._source is not None)
        if self._source is None:
            self._timer.stop()
        else:
            self._timer.start()
            self._poll()

    def hold(self, frame: SourceFrame | None) -> None:
        """Stay at a frozen image, whose name is then shown. None: play on, if it was playing."""
        if self._source is None:
            return
        if frame is not None and frame.index is not None:
            self._resumes = self._source.playback().playing
            self._source.pause()
            self._source.seek(frame.index)
        elif frame is None and self._resumes:
            self._resumes = False
            self._source.play()

    def _poll(self) -> None:
        if self._source is None:
            return
        now = self._source.playback()
        slider, loop, speed = map(QSignalBlocker, (self._slider, self._loop, self._speed))
        with slider, loop, speed:
            self._slider.setRange(0, max(now.count - 1, 0))
            self._slider.setValue(now.position)
            self._loop.setChecked(now.loop)
            self._speed.setCurrentIndex(self._speed.findData(now.speed))
        self._play.setChecked(now.playing)
        self._words.setText(playback_text(now))

    def _toggle(self) -> None:
        if self._source is not None:
            playing = self._source.playback().playing
            (self._source.pause if playing else self._source.play)()
            self._poll()
            if not playing:
                self._moved()

    def step(self, count: int) -> bool:
        """Move forward by a number of images. Return whether the images are stored."""
        if self._source is not None:
            self._resumes = False
            self._source.step(count)
            self._poll()
            self._moved()
        return self._source is not None

    def _seek(self, index: int) -> None:
        if self._source is not None:
            self._source.seek(index)
            self._moved()

    def _set_speed(self, index: int) -> None:
        if self._source is not None:
            self._source.set_speed(float(self._speed.itemData(index)))


def playback_text(now: Playback) -> str:
    """Return the position of a player as text."""
    if now.file:
        return f"{now.file},  image {now.position + 1} of {now.count}"
    text = f"{now.time_s:.2f} / {now.duration_s:.2f} s,  frame {now.position + 1} of {now.count}"
    return f"{text},  {now.damaged} damaged" if now.damaged else text
