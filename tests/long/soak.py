"""Let a random person use the program for an hour, and print whether it bears that.

    xvfb-run -a -s "-screen 0 1920x1200x24" python tests/long/soak.py --minutes 60 --seed 1
    ... --calibration sensor.gplcal    of the virtual sensor; without it there is no live depth

The real program runs on the virtual sensor. Every half minute everything that is open is closed,
and the Inspect page is left in peace for a while, in which it is measured: memory, threads, open
files, objects and timers, frames shown in a second, how late the user interface is, what the log
says, and the room on disk. Every action is written to actions.log in the scratch folder. The exit
status is 1 where memory grows, the rate falls, the program hangs or the log holds an error; the
files are kept then.
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
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QAbstractButton, QApplication, QDialog

WORKS_S, MEASURED_S = 20.0, 6.0
# A rest that is not reached by then is measured as it is.
LONGEST_UNREST_S = 240.0
HUNG_S = 60.0
LOOK_MS = 200
SETTLES_S = 5.0
RATE_HZ = 15.0
SIZE = 1400, 900
KEPT_RECORDINGS = 4
LEFT = ("calibrate.leave", "protocol.leave", "protocol.leave_result", "inspect.stop")


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
        self.spent = Spent()
        self._shown = 0
        self._began_s = time.monotonic()
        print(HEAD, flush=True)

    def begin(self) -> None:
        """Take the window, and let a person come."""
        from soak_figures import LogWatch
        from soak_person import Person

        from app.shell.main_window import MainWindow
        from app.sources.bench import Bench

        windows = QApplication.topLevelWidgets()
        self.window = next(w for w in windows if isinstance(w, MainWindow))
        self.context = self.window.context
        self.log = LogWatch(self.context.log)
        (self.scratch / "saved").mkdir()
        self._actions = (self.scratch / "actions.log").open("w", encoding="utf-8")
        self.person = Person(self.window, self.scratch, self._actions, self.options.seed)
        self.context.source.bench = Bench()
        self.context.source.bench.adjust(rate_hz=RATE_HZ)
        self._calibration: Path | None = None
        self._lateness = Lateness()
        self._look_after = QTimer(self.window)
        self._look_after.timeout.connect(self._still_alive)
        self._look_after.start(1000)
        self.window.page("inspect").depth.shown.connect(self._count)
        self._rest()

    def _count(self, _shown: object) -> None:
        self._shown += 1

    def _still_alive(self) -> None:
        faulthandler.dump_traceback_later(HUNG_S, file=self._hung)

    def _later(self, seconds: float, what: object) -> None:
        QTimer.singleShot(int(1e3 * seconds), self.window, what)

    def _rest(self) -> None:
        self.person.rest()
        self.person.note("rest")
        self._rests_by_s = time.monotonic() + LONGEST_UNREST_S
        self._close_next()

    def _close_next(self) -> None:
        """Close what is open, one thing at a time, until nothing is, and nothing is computed."""
        if (self._closed() and not self._computes()) or time.monotonic() > self._rests_by_s:
            self._arrange()
            self._later(SETTLES_S, self._begin_to_measure)
        else:
            self._later(1e-3 * LOOK_MS, self._close_next)

    def _closed(self) -> bool:
        """Close the uppermost menu or dialog, or show Inspect; whether there was nothing to do."""
        dialogs = [w for w in QApplication.topLevelWidgets() if isinstance(w, QDialog)]
        popup = QApplication.activePopupWidget()
        upper = (
            popup
            or QApplication.activeModalWidget()
            or next((dialog for dialog in dialogs if dialog.isVisible()), None)
        )
        if upper is not None:
            upper.close()
        elif self.window.page_name != "inspect":
            self.person.press("navigation.button.inspect")
        else:
            return True
        return False

    def _computes(self) -> bool:
        from app.measure.work import Work
        from app.services.jobs import Jobs
        from app.widgets.qt_tree import below

        parts = [*below(self.window, Jobs), *below(self.window, Work)]
        return any(part.busy for part in parts)

    def _arrange(self) -> None:
        """Put away sessions, runs and images, and show the same scene as at every rest."""
        from app.measure.press_view import PressView
        from app.widgets.qt_tree import below

        for kind in (QAction, QAbstractButton):
            for name in LEFT:
                for part in list(below(self.window, kind, name)):
                    part.trigger() if kind is QAction else part.click()
        for press_view in list(below(self.window, PressView)):
            press_view.release()
        page, source = self.window.page("inspect"), self.context.source
        page.recorder.stop()
        if page.live.paused:
            page.pause_action.trigger()
        self.window.showNormal()
        self.window.resize(*SIZE)
        page.findChild(QAction, "inspect.layout").trigger()
        self._use_calibration()
        source.choose_virtual_sensor()
        for fault in tuple(source.bench.conditions.faults):
            source.bench.switch(fault, False)
        source.bench.lay("ball")
        source.bench.adjust(rate_hz=RATE_HZ, noise=1.0, gain_db=0.0)

    def _use_calibration(self) -> None:
        """Put the calibration into use: most of what a frame costs is its own."""
        wanted, workspace = self.options.calibration, self.context.workspace
        if wanted is None:
            return
        if self._calibration is None or not self._calibration.is_file():
            self._calibration = workspace.import_calibration(wanted)
        if workspace.in_use != self._calibration:
            workspace.use(self._calibration)
            self.context.requests.calibrations_changed.emit()

    def _begin_to_measure(self) -> None:
        self._shown = 0
        self._lateness.late_ms.clear()
        self._later(MEASURED_S, self._measure)

    def _measure(self) -> None:
        from soak_figures import measured

        late = self._lateness.late_ms
        row = measured(self._began_s, self._shown / MEASURED_S, late, self.log, self.scratch)
        self.rows.append(row)
        print(row.reported(), flush=True)
        found = sorted(self.scratch.rglob("*.gplrec"), key=lambda path: path.stat().st_mtime)
        for path in found[:-KEPT_RECORDINGS]:
            path.unlink()
        if row.minutes < self.options.minutes:
            self.person.begin()
            self._later(WORKS_S, self._rest)
            return
        self._lateness.timer.stop()
        self._look_after.stop()
        self.log.look()
        self.person.note("close")
        self.window.close()


def conclude(soak: Soak, status: int, hung: Path) -> bool:
    """Print what came out; return whether all is well."""
    from soak_figures import conclude as conclude_figures

    output, wrong = conclude_figures(soak.rows)
    wrong += [f"in the log: {text}" for text in soak.log.errors]
    if status != 0:
        wrong.append(f"the program's exit status is {status}")
    if hung.stat().st_size:
        wrong.append(f"it hung for {HUNG_S:.0f} s:\n{hung.read_text()}")
    left = [t.name for t in threading.enumerate() if t is not threading.main_thread()]
    print(f"{soak.person.actions} actions in {len(soak.rows)} rounds; {soak.spent.reported()}")
    print(f"threads at the end: {', '.join(left) or 'none but the first'}")
    for text, count in soak.log.others.most_common():
        print(f"warned or refused {count} times: {text}")
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
    for name in ("CONFIG_HOME", "DATA_HOME", "STATE_HOME", "CACHE_HOME", "DOCUMENTS_DIR"):
        (scratch / name.lower()).mkdir(exist_ok=True)
        os.environ[f"XDG_{name}"] = str(scratch / name.lower())
    os.environ["HOME"] = str(scratch)
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
