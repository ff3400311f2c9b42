"""Let a first-time technician calibrate and validate the virtual sensor, and count the actions.

    xvfb-run -a -s "-screen 0 1400x1000x24" python tests/long/technician_trial.py
    ... --by-hand       click Capture and Next instead of waiting for the program
    ... --mistakes      make deliberate mistakes first; each must be refused or flagged

The real program starts with an empty home folder. Every action goes through the window, where a
mouse or a keyboard would act: a click, a key chord, or a value typed into a field counts as one.
Placing the next object on the virtual bench is a click, too. The exit status is 1 if the
calibration is not validated at the end, or if it took too many actions or too long.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import traceback
from pathlib import Path
from typing import TYPE_CHECKING

MOST_ACTIONS, MOST_MINUTES = 90, 12.0
# The last stage of a step takes some seconds on a quiet machine.
GOES_ON_S = 60.0
FOLDERS = (
    ("HOME", "."),
    ("XDG_CONFIG_HOME", "config"),
    ("XDG_DATA_HOME", "data"),
    ("XDG_STATE_HOME", "state"),
    ("XDG_DOCUMENTS_DIR", "documents"),
)
"""The compiled functions in XDG_CACHE_HOME are kept: an installed program brings them."""
IMAGE_STEPS = ("lens", "top_pose", "lights", "radiance", "background", "balls")

if TYPE_CHECKING:
    from counting_hand import CountingHand

    from app.calibrate.wizard import Wizard


class Trial:
    """Follows the wizard from the Start page to a validated calibration.

    Parameters
    ----------
    hand : CountingHand
        Acts and counts.
    by_hand : bool
        Click Capture and Next instead of waiting for the program.
    """

    def __init__(self, hand: CountingHand, *, by_hand: bool) -> None:
        self.hand, self.by_hand, self.done = hand, by_hand, False

    @property
    def wizard(self) -> Wizard | None:
        """The open wizard."""
        if self.hand.window.page_name != "calibrate":
            return None
        return self.hand.window.page("calibrate").wizard

    @property
    def step(self) -> str:
        """Key of the open step."""
        return "" if self.wizard is None else self.wizard.open.key

    def run(self) -> None:
        """Do everything."""
        hand = self.hand
        hand.begin("start")
        for name in ("first_steps.practice", "question.open", "setup.accept"):
            hand.click(name)
        hand.until(lambda: self.step, "the wizard")
        if self.step == "setup":
            hand.click("calibrate.next")
        for step in IMAGE_STEPS:
            self.images(step)
        hand.begin("result")
        hand.until(lambda: self.step == "result", "the result step")
        hand.click("result.save")
        hand.until(lambda: self.wizard.model.saved, "the saved calibration")
        hand.click("calibrate.next")
        self._validate()
        self.done = True

    def images(self, key: str) -> None:
        """Place the object of a step as often as it needs, until the step is complete."""
        hand = self.hand
        hand.until(lambda: self.step == key, f"the {key} step")
        hand.begin(key)
        wizard = self.wizard
        wizard.panel.automatic.setChecked(not self.by_hand)
        for number in range(wizard.open.wanted):
            hand.click("calibrate.lay")
            if self.by_hand:
                hand.pause()
                hand.until(self._good, f"a good image of {key}")
                hand.click("calibrate.capture")
            hand.until(lambda n=number: wizard.at(key).count() > n, f"image {number} of {key}")
        if self.by_hand:
            hand.until(lambda: wizard.model.page.finished, f"{key} is finished")
            hand.click("calibrate.next")
        else:
            hand.until(lambda: self.step != key, f"the step after {key}", GOES_ON_S)

    def _good(self) -> bool:
        """Return whether the sentence about the present image is green."""
        sentence = self.hand.see("calibrate.live")
        return sentence is not None and sentence.property("meaning") == "pass"

    def _validate(self) -> None:
        hand = self.hand
        hand.until(lambda: self.step == "validation", "the validation step")
        hand.begin("validation")
        hand.click("calibrate.lay")
        hand.click("calibrate.capture")
        hand.click("validation.keep")
        hand.until(lambda: self.validated, "the validated calibration")

    @property
    def validated(self) -> bool:
        """Whether the library holds a validated calibration."""
        entries = self.hand.window.context.workspace.entries()
        return any(entry.validated for entry in entries)


def main() -> None:
    """Run the program, print the table, and exit with 1 if the trial failed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--by-hand", action="store_true", help="click Capture and Next")
    parser.add_argument("--mistakes", action="store_true", help="make deliberate mistakes first")
    options = parser.parse_args()
    cache = os.environ.get("XDG_CACHE_HOME", str(Path.home() / ".cache"))
    with tempfile.TemporaryDirectory() as home:
        for variable, folder in FOLDERS:
            (Path(home) / folder).mkdir(exist_ok=True)
            os.environ[variable] = str(Path(home) / folder)
        os.environ["XDG_CACHE_HOME"] = cache
        sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
        well = run(by_hand=options.by_hand, mistakes=options.mistakes)
    sys.exit(0 if well else 1)


def run(*, by_hand: bool, mistakes: bool) -> bool:
    """Start the program, do the trial, and return whether it is within its limits."""
    from counting_hand import CountingHand
    from PySide6.QtCore import QTimer
    from PySide6.QtWidgets import QApplication

    from app import desktop
    from app.shell.main_window import MainWindow

    application, trials = desktop.make_application(), []

    def begin() -> None:
        windows = QApplication.topLevelWidgets()
        window = next(w for w in windows if isinstance(w, MainWindow))
        hand = CountingHand(window)
        if mistakes:
            from technician_mistakes import MistakenTrial

            trials.append(MistakenTrial(hand))
        else:
            trials.append(Trial(hand, by_hand=by_hand))
        try:
            trials[0].run()
        except (LookupError, TimeoutError) as error:
            wizard = trials[0].wizard
            states = {} if wizard is None else wizard.model.page.states
            print(f"{type(error).__name__}: {error}; states: {states}", flush=True)
        except Exception:  # the program itself would only log it
            traceback.print_exc()
        finally:
            print(trials[0].hand.table(), flush=True)
            window.close()

    QTimer.singleShot(1000, application, begin)
    desktop.run([])
    if mistakes:
        return trials[0].done and not trials[0].passed
    hand = trials[0].hand
    minutes = sum(hand.seconds.values()) / 60.0
    well = hand.counts.total() <= MOST_ACTIONS and minutes <= MOST_MINUTES
    return trials[0].done and well


if __name__ == "__main__":
    main()
