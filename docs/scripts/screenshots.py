"""Make the pictures of the documentation again, by working the program on the virtual sensor.

    xvfb-run -a -s "-screen 0 1400x1000x24" .venv/bin/python docs/scripts/screenshots.py

The whole guide is walked through, from the first start to the records: a sensor is calibrated
step by step, saved, validated, inspected and measured with. Settings and workspace are in a folder
that is deleted. On a quiet machine it takes about ten minutes. Pictures go to docs/pictures,
those that no scene makes any more are removed.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

import screenshot_calibrating as calibrating
import screenshot_camera as camera
import screenshot_using as using
from PySide6.QtCore import QSize
from screenshot_operator import Operator

from app.sources.virtual_bench import VirtualBench
from app.widgets import theme
from app.window.desktop import make_application, make_context
from app.window.main_window import MainWindow
from gelpolight_core.simulation.sensor_design import SensorDesign

PICTURES = Path(__file__).resolve().parents[1] / "pictures"
SIZE = QSize(1280, 800)
SCENES = (*calibrating.SCENES, *using.SCENES, camera.camera_settings)
"""In the order of the guide: each goes on where the one before it has ended."""
SCALE = 0.5
"""Of the virtual camera's pictures: a quarter of the pixels shows all that can be seen here."""
WHO = "technician"


def main() -> None:
    """Make all pictures."""
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("-o", "--out", type=Path, default=PICTURES, help="folder of the pictures")
    options.add_argument("--scale", type=float, default=SCALE, help="of the virtual camera")
    chosen = options.parse_args()
    chosen.out.mkdir(parents=True, exist_ok=True)
    os.environ["LOGNAME"] = WHO  # records and validations say who made them
    application = make_application()
    theme.apply(application, "light")
    with tempfile.TemporaryDirectory() as scratch:
        home = Path(scratch)
        context = make_context(settings_file=home / "desktop.ini", log_folder=home / "log")
        context.settings.prefer(theme="light")
        context.settings.prefer(captures_automatically=False, shows_first_steps=False)
        context.workspace.folder = home / "GelPoLight"
        context.source.bench = VirtualBench(SensorDesign().scaled(chosen.scale))
        window = MainWindow(context=context)
        window.resize(SIZE)
        window.show()
        operator = Operator(window, chosen.out)
        for scene in SCENES:
            scene(operator)
        window.close()
        context.workspace.close()
    remove_others(chosen.out, operator.taken)


def remove_others(folder: Path, names: list[str]) -> None:
    """Remove pictures that are not made any more."""
    for path in folder.glob("*.webp"):
        if path.stem not in names:
            path.unlink()
            print(f"{path}  removed: no scene makes it")


if __name__ == "__main__":
    main()
