"""Other programs that run while times are measured."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from gelpolight_core.translation import tr

PROC = Path("/proc")
QUIET_PERCENT = 15.0
"""Of one processor: the normal load of a desktop."""
LOOK_S = 2.0


@dataclass(frozen=True, slots=True)
class Machine:
    """The machine, and other programs that ran on it.

    Attributes
    ----------
    processors : int
        That this program may use.
    system, python : str
        Versions.
    waited_s : float
        For a quiet machine.
    others_percent : float or None
        Processor time of all other programs while this one measured, in percent of one processor;
        None if the system does not report it.
    busiest : tuple of str
        The busiest other programs at the end of the waiting time, in percent.
    """

    processors: int
    system: str
    python: str
    waited_s: float
    others_percent: float | None
    busiest: tuple[str, ...]

    @property
    def quiet(self) -> bool:
        """Whether other programs had no significant effect on the times."""
        return self.others_percent is not None and self.others_percent <= QUIET_PERCENT

    @property
    def text(self) -> str:
        """One sentence for people."""
        if self.others_percent is None:
            return tr("{n} processors; other running programs are not known").format(
                n=self.processors
            )
        text = tr("{n} processors; other programs used {p:.0f} % of one of them").format(
            n=self.processors, p=self.others_percent
        )
        return text if self.quiet else text + tr(": compare times with each other only")

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)


class Watch:
    """Waits until the machine is quiet, then measures the load by other programs.

    Parameters
    ----------
    most_s : float, optional
        Longest time to wait.
    progress : callable, optional
        Called while it waits, with the share of the time; its exceptions stop the waiting.
    """

    def __init__(
        self, most_s: float = 0.0, progress: Callable[[str, float], None] | None = None
    ) -> None:
        began = time.monotonic()
        while True:
            used, busiest = _look(LOOK_S)
            waited = time.monotonic() - began
            if used is None or used <= QUIET_PERCENT or waited >= most_s:
                break
            if progress is not None:
                progress(tr("waiting for a quiet machine"), min(waited / most_s, 1.0))
        self._waited_s, self._busiest = waited, busiest
        self._start = time.monotonic(), _busy_s(), sum(os.times()[:4])

    def result(self) -> Machine:
        """Return the load since the end of the waiting time."""
        then, busy, own = self._start
        now = _busy_s()
        others = None
        if busy is not None and now is not None:
            mine = sum(os.times()[:4]) - own
            others = max(0.0, 100.0 * (now - busy - mine) / max(time.monotonic() - then, 1e-3))
        return Machine(
            os.cpu_count() or 1,
            platform.platform(),
            platform.python_version(),
            self._waited_s,
            others,
            self._busiest,
        )


def _busy_s() -> float | None:
    """Return the processor time of all programs since the start of the machine."""
    try:
        numbers = [int(n) for n in (PROC / "stat").read_text().splitlines()[0].split()[1:9]]
    except (OSError, ValueError, IndexError):
        return None
    user, nice, system, _idle, _wait, interrupts, soft, _stolen = numbers
    return (user + nice + system + interrupts + soft) / float(os.sysconf("SC_CLK_TCK"))


def _look(seconds: float) -> tuple[float | None, tuple[str, ...]]:
    """Return the load by other programs, in percent of one processor, and their names."""
    before, programs = _busy_s(), _programs()
    began = time.monotonic()
    time.sleep(seconds)
    after, passed = _busy_s(), time.monotonic() - began
    if before is None or after is None:
        return None, ()
    used = [
        (100.0 * (spent - programs.get(key, spent)) / passed, key[1])
        for key, spent in _programs().items()
        if key[0] != os.getpid()
    ]
    top = [f"{name} {share:.0f} %" for share, name in sorted(used, reverse=True)[:3] if share >= 1]
    return 100.0 * (after - before) / passed, tuple(top)


def _programs() -> dict[tuple[int, str], float]:
    """Return the processor time of every program, by number and name."""
    found = {}
    for stat in PROC.glob("[0-9]*/stat"):
        try:
            text = stat.read_text()
        except OSError:
            continue  # it has ended
        name = text[text.index("(") + 1 : text.rindex(")")]
        rest = text[text.rindex(")") + 2 :].split()
        ticks = int(rest[11]) + int(rest[12])
        found[int(stat.parent.name), name] = ticks / float(os.sysconf("SC_CLK_TCK"))
    return found
