"""A recording as a source: plays what was recorded, in its own time or as the person likes."""

from __future__ import annotations

import logging
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.sources.source import Frame, Rgb, Setting, SourceLost
from gelpolight_core.errors import InputError
from gelpolight_core.recording.reader import Recording
from gelpolight_core.recording.recording import RecordingHeader
from gelpolight_core.translation import tr

_LOG = logging.getLogger(__name__)

SLOWEST, FASTEST = 0.1, 4.0
# A picture that stands still is shown again so often: captures of it do not wait for ever, and
# nobody takes the source for lost.
REPEAT_S = 0.2
LONE_FRAME_S = 0.1
SHORTEST_S = 1e-3
# So much of being late is made up for; more shifts what follows.
CATCH_UP_S = 0.1


@dataclass(frozen=True, slots=True)
class Playback:
    """Where a player is.

    Attributes
    ----------
    position : int
        Index of the frame that is shown.
    count : int
        Frames of the recording; 0 while it is closed.
    time_s, duration_s : float
        From the first frame.
    number : int
        The frame's number as recorded.
    playing, loop : bool
        Whether it plays now, and whether it begins again at the end.
    speed : float
        1 is the recording's own time.
    damaged : int
        Frames met so far that cannot be read, and are passed over.
    lost : int
        Frames that the source made while it was recorded, and that are not in the recording.
    truncated : bool
        Whether the recording was cut short or is damaged.
    """

    position: int = 0
    count: int = 0
    time_s: float = 0.0
    duration_s: float = 0.0
    number: int = 0
    playing: bool = True
    loop: bool = True
    speed: float = 1.0
    damaged: int = 0
    lost: int = 0
    truncated: bool = False


class RecordingSource:
    """The frames of a recording.

    Every frame is delivered, late if need be; only faster than in its own time are frames passed
    over, and counted as dropped. While the picture stands, the same frame comes again and again.

    Parameters
    ----------
    path : Path
        The recording.
    loop : bool, optional
        Whether to begin again after the last frame; otherwise it stops there.
    speed : float, optional
        0.1 to 4; 1 is the recording's own time.
    playing : bool, optional
        Whether to play at once.
    """

    kind = "recording"

    def __init__(
        self, path: Path, *, loop: bool = True, speed: float = 1.0, playing: bool = True
    ) -> None:
        self.path = Path(path)
        self.name = self.path.stem
        self.size = (0, 0)
        self._changed = threading.Condition()
        self._recording: Recording | None = None
        self._playing, self._loop, self._speed = playing, loop, speed
        self._position, self._direction = 0, 1
        self._pending: int | None = 0
        self._number = -1
        self._due_s = self._delivered_s = 0.0
        self._shown: tuple[int, Rgb] | None = None
        self._damaged: set[int] = set()

    @property
    def header(self) -> RecordingHeader | None:
        """What the recording says of itself; None while it is closed."""
        with self._changed:
            return None if self._recording is None else self._recording.header

    def open(self) -> None:
        """Open the file and go to its beginning."""
        with self._changed:
            if self._recording is not None:
                return
            recording = Recording.open(self.path)
            if not len(recording):
                recording.close()
                raise InputError(
                    tr("the recording holds no frames"),
                    where=str(self.path),
                    advice=tr("Choose another one"),
                )
            self._recording, self.size = recording, recording.size
            self._pending, self._number, self._shown = 0, -1, None
            self._damaged.clear()

    def frame(self, timeout_s: float) -> Frame | None:
        """Wait for the next frame; None if its time has not come."""
        end_s = time.monotonic() + timeout_s
        with self._changed:
            while True:
                if self._recording is None:
                    raise SourceLost(
                        tr("it is closed"),
                        where=str(self.path),
                        advice=tr("Open the recording again"),
                    )
                now_s = time.monotonic()
                index, due_s = self._next(now_s)
                if due_s <= now_s:
                    self._number += 1 if index is None else self._move_to(index, due_s, now_s)
                    self._delivered_s = now_s
                    recording, index, number = self._recording, self._position, self._number
                    break
                if now_s >= end_s:
                    return None
                self._changed.wait(min(due_s, end_s) - now_s)
        rgb = self._read(recording, index)
        return None if rgb is None else Frame(rgb, number, time.monotonic())

    def settings(self) -> tuple[Setting, ...]:
        """Return the one setting, the speed."""
        return (Setting("speed", tr("Speed"), "x", SLOWEST, FASTEST, 0.1, self._speed),)

    def set(self, key: str, value: float) -> float:
        """Change the speed."""
        (speed,) = self.settings()
        if key != speed.key:
            raise InputError(
                tr("it has no setting {key}").format(key=key),
                where=self.name,
                advice=tr("Use {key}").format(key=speed.key),
            )
        with self._changed:
            self._speed = speed.nearest(value)
            self._changed.notify_all()
        return self._speed

    def close(self) -> None:
        """Give the file back."""
        with self._changed:
            recording, self._recording = self._recording, None
            self._shown = None
            self._changed.notify_all()
        if recording is not None:
            recording.close()

    def playback(self) -> Playback:
        """Return where the player is; any thread may ask."""
        with self._changed:
            recording = self._recording
            if recording is None:
                return Playback(playing=self._playing, loop=self._loop, speed=self._speed)
            at = self._position if self._pending is None else self._pending
            return Playback(
                position=at,
                count=len(recording),
                time_s=float(recording.times_s[at] - recording.times_s[0]),
                duration_s=recording.duration_s,
                number=int(recording.numbers[at]),
                playing=self._playing,
                loop=self._loop,
                speed=self._speed,
                damaged=len(self._damaged),
                lost=recording.lost,
                truncated=recording.truncated,
            )

    def play(self) -> None:
        """Go on; from the beginning where the end was reached."""
        with self._changed:
            if not self._playing and self._following() is None:
                self._pending = 0
            self._playing, self._due_s = True, time.monotonic()
            self._changed.notify_all()

    def pause(self) -> None:
        """Stand still on the frame that is shown."""
        with self._changed:
            self._playing = False
            self._changed.notify_all()

    def seek(self, index: int) -> None:
        """Show a frame, the nearest one where there is none of this index; then go on as before."""
        with self._changed:
            if self._recording is not None:
                self._pending = min(max(index, 0), len(self._recording) - 1)
                self._changed.notify_all()

    def step(self, count: int = 1) -> None:
        """Stand still, so many frames on (or back)."""
        with self._changed:
            self._playing = False
            self._direction = 1 if count > 0 else -1
            at = self._position if self._pending is None else self._pending
        self.seek(at + count)

    def set_loop(self, loop: bool) -> None:
        """Choose whether to begin again after the last frame."""
        with self._changed:
            self._loop = loop
            self._changed.notify_all()

    def _following(self) -> int | None:
        """Return the frame after the one that is shown; None at the end."""
        assert self._recording is not None
        if self._position + 1 < len(self._recording):
            return self._position + 1
        return 0 if self._loop else None

    def _next(self, now_s: float) -> tuple[int | None, float]:
        """Return which frame comes next, None for the same again, and when."""
        if self._pending is not None:
            return self._pending, now_s
        again_s = self._delivered_s + REPEAT_S
        following = self._following() if self._playing else None
        if following is None:
            self._playing = False
            return None, again_s
        due_s = self._due_s + self._interval_s(self._position)
        return (following, due_s) if due_s <= again_s else (None, again_s)

    def _interval_s(self, index: int) -> float:
        """Return how long a frame is shown."""
        assert self._recording is not None
        times_s, own_s = self._recording.times_s, LONE_FRAME_S
        if index + 1 < len(times_s):
            own_s = float(times_s[index + 1] - times_s[index])
        elif len(times_s) > 1:
            own_s = float(np.median(np.diff(times_s)))
        return max(own_s, SHORTEST_S) / self._speed

    def _move_to(self, index: int, due_s: float, now_s: float) -> int:
        """Make a frame the one that is shown, or a later one if hurried; return how many on."""
        self._pending, self._position, counted = None, index, 1
        while self._speed > 1.0:
            following, next_s = self._following(), due_s + self._interval_s(self._position)
            if following is None or next_s > now_s:
                break
            self._position, due_s, counted = following, next_s, counted + 1
        self._due_s = max(due_s, now_s - CATCH_UP_S)
        return counted

    def _read(self, recording: Recording, index: int) -> Rgb | None:
        """Return a frame's picture; None for one that is damaged."""
        if self._shown is not None and self._shown[0] == index:
            return self._shown[1]
        try:
            rgb = recording.frame(index).rgb
        except InputError as error:
            if index not in self._damaged:
                _LOG.warning("%s", error)
            with self._changed:
                self._damaged.add(index)
                if len(self._damaged) == len(recording):
                    raise
                if not self._playing and self._pending is None:
                    self._pending = (index + self._direction) % len(recording)
            return None
        self._shown = (index, rgb)
        return rgb
