"""The mistakes of a first-time technician: each must be refused or flagged, with what to do."""

from __future__ import annotations

from counting_hand import CountingHand
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from technician_trial import Trial

from gelpolight_core.translation import tr

WRONG_OBJECTS = {
    "lens": "mirror",
    "top_pose": "checkerboard",
    "lights": "bare",
    "radiance": "coin",
    "background": "ball",
    "balls": "cuboid",
}
WRONG_DIAMETER_MM = 3.0
DRAG_PX = 60
# Longer than the program needs to find an image still and good, and to capture it.
TEMPTED_S = 4.0


class MistakenTrial(Trial):
    """A trial with deliberate mistakes before the right action of each step.

    Attributes
    ----------
    passed : list of str
        Mistakes without any message.
    """

    def __init__(self, hand: CountingHand) -> None:
        super().__init__(hand, by_hand=False)
        self.passed: list[str] = []

    def images(self, key: str) -> None:
        """Make the mistakes of a step, then do it right."""
        self.hand.until(lambda: self.step == key, f"the {key} step")
        self._early_next(key)
        self._wrong_object(key)
        if key == "balls":
            self._wrong_diameter()
        super().images(key)
        if key == "lights":
            self._moved_centroid()

    def _note(self, mistake: str, *, held: bool, answer: str) -> None:
        print(f"{mistake}: {'held' if held else 'PASSED'}: {answer}", flush=True)
        if not held:
            self.passed.append(mistake)

    def _early_next(self, key: str) -> None:
        self.hand.click("calibrate.next")
        answer = self.wizard.panel.notice.text()
        self._note(f"early Next in {key}", held=self.step == key and bool(answer), answer=answer)

    def _wrong_object(self, key: str) -> None:
        item = WRONG_OBJECTS[key]
        self.hand.window.context.source.bench.lay(item)
        self._tempt(f"{item} in {key}")

    def _wrong_diameter(self) -> None:
        """State the radius of the first ball in place of its diameter, then press it."""
        bench = self.hand.window.context.source.bench
        bench.lay("bare")
        self.hand.enter("calibrate.radius", str(WRONG_DIAMETER_MM))
        bench.show("balls", 0)
        self._tempt(f"ball stated as {WRONG_DIAMETER_MM:g} mm")

    def _tempt(self, mistake: str) -> None:
        """Give automatic capture time to fall for it."""
        count, panel = self.wizard.open.count(), self.wizard.panel
        self.hand.pause()
        changing = tr("The image is changing.")
        self.hand.until(lambda: panel.live.text() != changing, "the image of the mistake")
        self.hand.pause(TEMPTED_S)
        amber = panel.live.property("meaning") != "pass"
        held = amber and self.wizard.open.count() == count
        self._note(mistake, held=held, answer=panel.live.text())

    def _moved_centroid(self) -> None:
        """Go back, drag the first LED's spot to a dark place, and undo it."""
        hand, wizard = self.hand, self.wizard
        keys = [one.key for one in wizard.steps]
        hand.click_item(wizard.step_list, keys.index("lights"))
        hand.until(lambda: wizard.area.strip.count(), "the captured mirror")
        hand.click_item(wizard.area.strip, 0)
        view = wizard.area.view.image
        hand.until(lambda: view.overlay.handles, "the handles of the spots")
        hand.pause()
        spot = view.overlay.handles[0]
        there = QPoint(*(round(c) for c in view.view_position(spot.u, spot.v)))
        QTest.mousePress(view.viewport(), Qt.MouseButton.LeftButton, pos=there)
        for share in (0.3, 0.6, 1.0):
            QTest.mouseMove(view.viewport(), there + QPoint(round(share * DRAG_PX), 0), delay=50)
        end = there + QPoint(DRAG_PX, 0)
        QTest.mouseRelease(view.viewport(), Qt.MouseButton.LeftButton, pos=end, delay=50)
        model = wizard.model
        hand.until(lambda: model.undo.canUndo() and not model.busy, "the moved spot")
        hand.pause(2.0)
        state, sentence = model.page.states["lights"]
        self._note("moved centroid", held=state in ("warn", "fail"), answer=f"{state}: {sentence}")
        hand.window.activateWindow()  # without a window manager no window may be active
        hand.pause()
        QTest.keyClick(wizard, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
        hand.until(lambda: not model.busy, "the undone drag")
        hand.click_item(wizard.step_list, keys.index("radiance"))
