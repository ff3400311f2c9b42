"""A wizard at work until it is killed: ``python wizard_at_work.py SESSION IMAGES SEED``.

Captures and corrects in turn on a session, and writes one JSON line for everything that is
reported as done; for data that replaces older data, also when it starts.
"""

import json
import random
import sys
from pathlib import Path

from PySide6.QtCore import QTimer
from technician import ScriptedCamera, read_rgb

from app.calibrate.page import CalibratePage
from app.calibrate.wizard import Wizard
from app.desktop import make_application, make_context
from app.sources.source import SourceInfo
from gelpolight_core.session.decisions import PlacedCircle

TICK_MS = 5


def progress(**done: object) -> None:
    """Write a line about finished work."""
    sys.stdout.write(json.dumps(done) + "\n")
    sys.stdout.flush()


class Work:
    """Starts the next action whenever the previous one is done."""

    def __init__(self, wizard: Wizard, camera: ScriptedCamera, images: Path, seed: int) -> None:
        self._wizard, self._camera, self._images = wizard, camera, images
        self._random = random.Random(seed)
        wizard.model.captured.connect(self._on_captured)
        self._on_step("lens")

    def _on_step(self, key: str) -> None:
        self._wizard.go_to(key)
        folder = self._wizard.open.folder
        files = sorted((self._images / folder).glob("*.png"))
        self._camera.show(read_rgb(self._random.choice(files)))

    def _on_captured(self, stage: str, name: str) -> None:
        session = self._wizard.project.session
        radius = session.ball_radii_mm.get(name) if stage == "balls" else None
        progress(captured=f"{self._wizard.project.recipe[stage].folder}/{name}", radius_mm=radius)

    def go_on(self) -> None:
        """Start a random action."""
        controller = self._wizard.model
        if controller.busy_with_images:
            return
        chance = self._random.random()
        session = self._wizard.project.session
        if chance < 0.15:
            self._on_step(self._random.choice(("lens", "balls", "balls", "lights", "background")))
        elif chance < 0.3 and (views := session.found("checkerboard")):
            name = self._random.choice(views).name
            controller.exclude("lens", name, True)
            progress(excluded=f"checkerboard/{name}")
        elif chance < 0.5 and (balls := session.found("balls")):
            name = self._random.choice(balls).name
            position = [float(self._random.randrange(20, 220)) for _ in range(3)]
            progress(begun=name, value=position)
            self._wizard.at("balls").place_ball(name, PlacedCircle(*position))
            progress(decided=name, value=position)
        elif chance < 0.6:
            nodes = [[0.0, 0.0], [0.5, 0.25 + 0.01 * self._random.randrange(20)], [1.0, 1.0]]
            project = self._wizard.project
            progress(begun="curve", value=nodes)
            project.edit_curves({0: tuple((c, v) for c, v in nodes)})
            progress(decided="curve", value=nodes)
        else:
            self._wizard.at("balls").radius.setValue(4.0 + 0.2 * self._random.randrange(10))
            self._wizard.panel.capture.click()


def main() -> None:
    """Work until the process is killed."""
    session, images, seed = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    application = make_application()
    context = make_context(settings_file=session.parent / "desktop.ini")
    context.workspace.folder = session.parent / "workspace"
    camera = ScriptedCamera()
    context.source.choose(SourceInfo("camera", camera.name, "", lambda: camera))
    page = CalibratePage(context=context)
    page.show()
    page.enter()
    page.open_path(session)
    assert page.wizard is not None
    work = Work(page.wizard, camera, images, seed)
    timer = QTimer(interval=TICK_MS)
    timer.timeout.connect(work.go_on)
    timer.start()
    application.exec()


if __name__ == "__main__":
    main()
