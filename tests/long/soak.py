"""Let a random person use the program for an hour, and print whether it bears that.

    xvfb-run -a -s "-screen 0 1920x1200x24" python tests/long/soak.py --minutes 60 --seed 1
    ... --calibration sensor.gplcal    of the virtual sensor; without it there is no live depth

The real program runs on the virtual sensor, whose camera makes 15 frames a second. What is compiled
when it is used first is used once; then a random person comes. Every half minute the program is
brought to the same state, and when nothing is computed any more it is left in peace for some
seconds, in which it is measured: memory, threads, open files, objects and timers, frames shown in a
second, how late the user interface is, what the log says, and the room on disk. Every fourth time
the session, the protocol's run and the image that is measured are put away: these times say whether
memory grows, apart from what the C library keeps of what was given back to it. Every action is
written to actions.log in the scratch folder. The exit status is 1 where memory grows, the rate
drifts, or the log holds an error; the files are kept then.
"""

from __future__ import annotations

import argparse
import faulthandler
import os
import shutil
import sys
import tempfile
import threading
import time
from pathlib import Path

from probes import Lateness, Spent
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

EVERY_S = 30.0
RESTS_S = 3.0
MEASURED_S = 6.0
# A rest that is not reached by then is a fault; a computation may take longer.
LONGEST_UNREST_S = 40.0
LONGEST_COMPUTING_S = 240.0
HUNG_S = 60.0
LOOK_MS = 100
FIRST_USE_S = 4.0
# Every so many rests all that is open is put away.
EMPTIED_EVERY = 4
KEPT_RECORDINGS = 4
DONE = object()


class Soak:
    """Acts and rests by turns until the time is over.

    Parameters
    ----------
    options : Namespace
        Of the command.
    scratch : Path
        Folder for everything that is written.
    hung : file
        Takes where the program hangs.
    """

    def __init__(self, options: argparse.Namespace, scratch: Path, hung: int) -> None:
        # Heavy, and only after the folders of the user are set.
        from soak_figures import HEAD

        self.options, self.scratch, self._hung = options, scratch, hung
        self.rows: list = []
        self.troubles: list[str] = []
        self.spent = Spent()
        self._began_s = time.monotonic()
        print(HEAD, flush=True)

    def begin(self) -> None:
        """Take the window, and let a person come."""
        from soak_figures import LogWatch
        from soak_person import Person
        from soak_rest import RATE_HZ, Rest

        from app.shell.main_window import MainWindow
        from app.sources.bench import Bench

        windows = QApplication.topLevelWidgets()
        self.window = next(w for w in windows if isinstance(w, MainWindow))
        context = self.window.context
        self.log = LogWatch(context.log)
        (self.scratch / "saved").mkdir()
        self._actions = (self.scratch / "actions.log").open("w", encoding="utf-8")
        self.person = Person(self.window, self.scratch, self._actions, self.options.seed)
        context.source.bench = Bench()
        context.source.bench.adjust(rate_hz=RATE_HZ)
        self.rest = Rest(self.window, self.person, self.options.calibration)
        self.rest.use_calibration()
        self.lateness = Lateness()
        self._look_after = QTimer(self.window)
        self._look_after.timeout.connect(self._still_alive)
        self._look_after.start(1000)
        self._first_uses = self.rest.first_uses()
        self._use_first()

    def _use_first(self) -> None:
        if self.rest.computes or next(self._first_uses, DONE) is not DONE:
            self._later(FIRST_USE_S, self._use_first)
        else:
            self._rest()

    def _still_alive(self) -> None:
        faulthandler.dump_traceback_later(HUNG_S, file=self._hung)

    def _later(self, seconds: float, what: object) -> None:
        QTimer.singleShot(int(1e3 * seconds), self.window, what)

    def _work(self) -> None:
        self.person.begin()
        self._later(EVERY_S - RESTS_S - MEASURED_S, self._rest)

    # Rest

    def _rest(self) -> None:
        self.person.rest()
        self.person.note("rest")
        self._rests_by_s = time.monotonic() + LONGEST_UNREST_S
        self._computed_by_s = time.monotonic() + LONGEST_COMPUTING_S
        self._emptied = len(self.rows) % EMPTIED_EVERY == EMPTIED_EVERY - 1
        self.rest.begin(emptied=self._emptied)
        self._settle()

    def _settle(self) -> None:
        """Close what is open, one thing at a time, until the program looks as at every rest."""
        from soak_rest import COMPUTES, UNSETTLED

        undone, now_s = self.rest.undone(), time.monotonic()
        if undone == COMPUTES and now_s < self._computed_by_s:
            self._rests_by_s = now_s + LONGEST_UNREST_S
        if undone and now_s < self._rests_by_s:
            self._later(1e-3 * LOOK_MS, self._settle)
            return
        if undone == UNSETTLED:
            self.person.note(undone)  # a busy machine renders for long
        elif undone:
            self._trouble(f"it does not come to rest: {undone}")
        self._later(RESTS_S, self._measure)

    def _trouble(self, sentence: str) -> None:
        where = f"after {(time.monotonic() - self._began_s) / 60.0:.1f} minutes"
        self.troubles.append(f"{where}: {sentence}")
        print(self.troubles[-1], flush=True)

    def _measure(self) -> None:
        from soak_figures import Look

        self._looked = Look(lambda: self.rest.shown, self.lateness)
        self._later(MEASURED_S, self._measured)

    def _measured(self) -> None:
        row = self._looked.row(self._began_s, self.log, self.scratch, emptied=self._emptied)
        self.rows.append(row)
        print(row.reported(), flush=True)
        self._forget_recordings()
        if row.minutes >= self.options.minutes:
            self.lateness.timer.stop()
            self._look_after.stop()
            self.log.look()
            self.person.note("close")
            self.window.close()
            return
        self._work()

    def _forget_recordings(self) -> None:
        found = sorted(self.scratch.rglob("*.gplrec"), key=lambda path: path.stat().st_mtime)
        for path in found[:-KEPT_RECORDINGS]:
            path.unlink()


def conclude(soak: Soak, status: int, hung: Path) -> bool:
    """Print what came out; return whether all is well."""
    from soak_figures import conclude as conclude_figures

    output, wrong = conclude_figures(soak.rows)
    wrong += soak.troubles
    wrong += [f"in the log: {text}" for text in soak.log.errors]
    if status != 0:
        wrong.append(f"the program's exit status is {status}")
    if hung.stat().st_size:
        wrong.append(f"it hung for {HUNG_S:.0f} s:\n{hung.read_text()}")
    left = [t.name for t in threading.enumerate() if t is not threading.main_thread()]
    print(f"{soak.person.actions} actions in {len(soak.rows)} rounds; {soak.spent.reported()}")
    print(f"threads at the end: {', '.join(left) or 'none but the first'}")
    for text, count in soak.log.warnings.most_common():
        print(f"warning, {count} times: {text}")
    for text, count in soak.log.reported.most_common():
        print(f"refused {count} times: {text}")
    print("\n".join(output))
    print("\n".join(f"WRONG: {sentence}" for sentence in wrong) or "Nothing is wrong.")
    return not wrong


def main() -> None:
    """Run the program, and exit with 1 where something is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0, help="of the actions")
    parser.add_argument("--calibration", type=Path, help="of the virtual sensor")
    parser.add_argument("--scratch", type=Path, help="folder for all that is written, kept")
    options = parser.parse_args()
    scratch = options.scratch or Path(tempfile.mkdtemp(prefix="gelpolight-soak-"))
    scratch.mkdir(parents=True, exist_ok=True)
    for variable, folder in (
        ("HOME", "."),
        ("XDG_CONFIG_HOME", "config"),
        ("XDG_DATA_HOME", "data"),
        ("XDG_STATE_HOME", "state"),
        ("XDG_CACHE_HOME", "cache"),
        ("XDG_DOCUMENTS_DIR", "documents"),
    ):
        (scratch / folder).mkdir(exist_ok=True)
        os.environ[variable] = str(scratch / folder)
    # With threads, Mesa's renderer in software keeps the room of its largest drawings, the more of
    # it the busier the machine: tens of megabytes an hour that are not the program's.
    os.environ.setdefault("LP_NUM_THREADS", "0")
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    from app import desktop

    hung = scratch / "hung.log"
    application = desktop.make_application()
    with hung.open("w") as place:
        soak = Soak(options, scratch, place.fileno())
        QTimer.singleShot(2000, application, soak.begin)
        status = desktop.run([])
        faulthandler.cancel_dump_traceback_later()
    well = conclude(soak, status, hung)
    if well and options.scratch is None:
        shutil.rmtree(scratch)
    else:
        print(f"kept: {scratch}")
    sys.exit(0 if well else 1)


if __name__ == "__main__":
    main()
