"""A recording as a source: plays it at its own speed or under the user's control."""

from __future__ import annotations

import logging
from pathlib import Path

from gelpolight_core.base.arrays import PixelArray
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.output.recording.recording_format import RecordingHeader
from gelpolight_core.output.recording.recording_reader import Recording

from .player import Player

_LOG = logging.getLogger(__name__)


class RecordingSource(Player):
    """Plays the frames of a recording.

    Parameters
    ----------
    path : Path
        Path of the recording.
    """

    kind = "recording"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.name = self.path.stem
        self._recording: Recording | None = None
        self._damaged: set[int] = set()

    @property
    def header(self) -> RecordingHeader | None:
        """Header of the recording, or None while it is closed."""
        with self._changed:
            return None if self._recording is None else self._recording.header

    def open(self) -> None:
        """Open the file and go to its start."""
        with self._changed:
            if self._recording is not None:
                return
            recording = Recording.open(self.path)
            if not len(recording):
                recording.close()
                raise InputError("the recording contains no frames", self.path, Remedy.CHOOSE_FILE)
            self._recording = recording
            self._rewind(recording.times_s)
            self._damaged.clear()
            self._change(damaged=0)

    def close(self) -> None:
        """Close the file."""
        super().close()
        with self._changed:
            recording, self._recording = self._recording, None
        if recording is not None:
            recording.close()

    def image_name(self, index: int) -> str:
        """Return the name of a frame: that of the recording, with the index."""
        return f"{self.name}-{index:05d}.png"

    def _read(self, index: int) -> PixelArray | None:
        recording = self._recording
        assert recording is not None
        try:
            return recording.frame(index).rgb
        except InputError as error:
            if index not in self._damaged:
                _LOG.warning("%s", error)
            with self._changed:
                self._damaged.add(index)
                self._change(damaged=len(self._damaged))
                if len(self._damaged) == len(recording):
                    raise
                if not self._now.playing and self._pending is None:
                    self._pending = (index + self._direction) % len(recording)
            return None
