"""Stored images as a source: played at their own speed or under the user's control."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import PixelArray

from .source import SourceFrame, SourceSetting, source_closed_error

# A paused image is sent this often, so that captures do not wait forever and the source does not
# count as lost.
REPEAT_S = 0.2
# Delays up to this limit are caught up; longer ones shift the following frames.
CATCH_UP_S = 0.1


@dataclass(frozen=True, slots=True)
class Playback:
    """The state of a player.

    Attributes
    ----------
    position : int
        Index of the shown frame.
    count : int
        Number of frames; 0 while it is closed.
    file : str
        File of the shown frame, if each has one of its own.
    time_s, duration_s : float
        Time from the first frame.
    playing, loop : bool
        Whether it is playing, and whether it restarts at the end.
    speed : float
        1 is the original speed.
    damaged : int
        Unreadable frames skipped so far.
    """

    position: int = 0
    count: int = 0
    file: str = ""
    time_s: float = 0.0
    duration_s: float = 0.0
    playing: bool = True
    loop: bool = True
    speed: float = 1.0
    damaged: int = 0


class Player:
    """Plays stored frames: the base of recordings and of folders of images.

    Every frame is delivered, late if necessary; frames are skipped, and counted as dropped, only
    above the original speed. While paused, the same frame is sent repeatedly.

    Parameters
    ----------
    path : Path
        The file or folder.
    playing : bool, optional
        Whether it plays at first.
    """

    def __init__(self, path: Path, *, playing: bool = True) -> None:
        self.path = Path(path)
        self._changed = threading.Condition()
        self._times_s: NDArray[np.float64] = np.empty(0)  # of the frames; empty while closed
        self._now = Playback(playing=playing)
        self._position, self._direction = 0, 1
        self._pending: int | None = 0
        self._number = -1
        self._due_s = self._delivered_s = 0.0
        self._shown: tuple[int, PixelArray] | None = None

    def image_name(self, index: int) -> str:
        """Return the file name of a frame, after which exports of it are named."""
        raise NotImplementedError

    def _read(self, index: int) -> PixelArray | None:
        """Return the image of a frame, or None if it is damaged."""
        raise NotImplementedError

    def _rewind(self, times_s: NDArray[np.float64]) -> None:
        """Go to the first frame of those with these times, or to where it is resumed."""
        self._times_s = times_s
        self._pending = min(self._now.position, len(times_s) - 1)
        self._number, self._shown = -1, None

    def frame(self, timeout_s: float) -> SourceFrame | None:
        """Wait for the next frame. None: it is not due yet."""
        end_s = time.monotonic() + timeout_s
        with self._changed:
            while True:
                if not self._times_s.size:
                    raise source_closed_error(str(self.path))
                now_s = time.monotonic()
                index, due_s = self._next(now_s)
                if due_s <= now_s:
                    self._number += 1 if index is None else self._move_to(index, due_s, now_s)
                    self._delivered_s = now_s
                    position, number, paused = self._position, self._number, not self._now.playing
                    break
                if now_s >= end_s:
                    return None
                self._changed.wait(min(due_s, end_s) - now_s)
        if self._shown is None or self._shown[0] != position:
            if (rgb := self._read(position)) is None:
                return None
            self._shown = position, rgb
        name, rgb, time_s = self.image_name(position), self._shown[1], time.monotonic()
        return SourceFrame(rgb, number, time_s, index=position, name=name, paused=paused)

    def settings(self) -> tuple[SourceSetting, ...]:
        """Return none."""
        return ()

    def set_speed(self, speed: float) -> None:
        """Change the speed. 1 is the original one."""
        with self._changed:
            self._change(speed=speed)

    def close(self) -> None:
        """Discard the images."""
        with self._changed:
            self._times_s, self._shown = np.empty(0), None
            self._changed.notify_all()

    def playback(self) -> Playback:
        """Return the state of the player, for any thread."""
        with self._changed:
            times_s = self._times_s
            if not times_s.size:
                return self._now
            position = self._position if self._pending is None else self._pending
            return replace(
                self._now,
                position=position,
                count=len(times_s),
                time_s=float(times_s[position] - times_s[0]),
                duration_s=float(times_s[-1] - times_s[0]),
            )

    def resume(self, playback: Playback) -> None:
        """Begin in the state of another player of these frames, once it is opened."""
        self._now = playback

    def play(self) -> None:
        """Continue to play, or play from the start if the end was reached."""
        with self._changed:
            if not self._now.playing and self._following() is None:
                self._pending = 0
            self._due_s = time.monotonic()
            self._change(playing=True)

    def pause(self) -> None:
        """Pause at the shown frame."""
        with self._changed:
            self._change(playing=False)

    def seek(self, index: int) -> None:
        """Go to a frame, or the nearest one if the index does not exist."""
        with self._changed:
            if self._times_s.size:
                self._pending = min(max(index, 0), len(self._times_s) - 1)
                self._changed.notify_all()

    def step(self, count: int = 1) -> None:
        """Pause, and move forward by a number of frames (back if negative)."""
        self.pause()
        with self._changed:
            self._direction = 1 if count > 0 else -1
            position = self._position if self._pending is None else self._pending
        self.seek(position + count)

    def set_loop(self, loop: bool) -> None:
        """Set whether to restart after the last frame, or to pause there."""
        with self._changed:
            self._change(loop=loop)

    def _change(self, **values: Any) -> None:
        """Change some of the state, and let the waiting thread see it."""
        self._now = replace(self._now, **values)
        self._changed.notify_all()

    def _following(self) -> int | None:
        """Return the index of the next frame, or None at the end."""
        if self._position + 1 < len(self._times_s):
            return self._position + 1
        return 0 if self._now.loop else None

    def _next(self, now_s: float) -> tuple[int | None, float]:
        """Return the frame that is due next, with its time. None: the same frame again."""
        if self._pending is not None:
            return self._pending, now_s
        again_s = self._delivered_s + REPEAT_S
        following = self._following() if self._now.playing else None
        if following is None:
            self._now = replace(self._now, playing=False)
            return None, again_s
        due_s = self._due_s + self._interval_s(self._position)
        return (following, due_s) if due_s <= again_s else (None, again_s)

    def _interval_s(self, index: int) -> float:
        """Return how long a frame is shown, in seconds."""
        times_s, interval_s = self._times_s, 0.1
        if index + 1 < len(times_s):
            interval_s = float(times_s[index + 1] - times_s[index])
        elif len(times_s) > 1:
            interval_s = float(np.median(np.diff(times_s)))
        return max(interval_s, 1e-3) / self._now.speed

    def _move_to(self, index: int, due_s: float, now_s: float) -> int:
        """Show a frame, or a later one when behind schedule. Return the number of steps."""
        self._pending, self._position, counted = None, index, 1
        while self._now.speed > 1.0:
            following, next_s = self._following(), due_s + self._interval_s(self._position)
            if following is None or next_s > now_s:
                break
            self._position, due_s, counted = following, next_s, counted + 1
        self._due_s = max(due_s, now_s - CATCH_UP_S)
        return counted
