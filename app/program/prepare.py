"""The virtual sensor of the program: simulated, calibrated and validated once for each version.

The set-up does it (:mod:`app.cli.warm_up`), so that the first start shows a depth at once.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import platformdirs

from gelpolight_core.base.atomic_write import make_folder
from gelpolight_core.base.compared_quantity import TOLERANCE_PERCENT
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.version import __version__
from gelpolight_core.calibration.manifest import VERSION
from gelpolight_core.simulation.sensor_design import SensorDesign

# The smallest image, and the fewest balls, with which every figure of the calibration passes.
SCALE, BALLS = 0.375, 8
# Measured: making the images takes about a quarter of the time.
IMAGES_SHARE = 0.25
ProgressCallback = Callable[[float], None]


def virtual_design() -> SensorDesign:
    """Return the design of the virtual sensor. Its one press is the cylinder that validates it."""
    design = SensorDesign().scaled(SCALE)
    cylinder = next(press for press in design.presses if press.shape == "cylinder")
    return replace(design, balls=design.balls[:BALLS], presses=(replace(cylinder, depth_mm=1.0),))


def folders() -> tuple[Path, ...]:
    """Return where the calibration can be: beside the program, or in the folder of the user."""
    return (
        Path(sys.prefix, "share", "gelpolight", "demo"),
        platformdirs.user_data_path("gelpolight") / "demo",
    )


def prepared() -> Path | None:
    """Return the calibration of the virtual sensor, if this version has made it."""
    return next((path for folder in folders() if (path := _path_in(folder)).is_file()), None)


def _path_in(folder: Path) -> Path:
    """Return the path of the calibration. It names everything that decides on its content."""
    design = virtual_design()
    key = sha256(repr((__version__, VERSION, design)).encode()).hexdigest()[:16]
    return folder / key / f"{design.serial}.gplcal"


def prepare(
    progress: ProgressCallback = lambda _share: None,
    say: Callable[[str], object] = lambda _line: None,
    *,
    again: bool = False,
) -> Path:
    """Make the calibration of the virtual sensor, and validate it, unless this has been done.

    Parameters
    ----------
    progress : callable, optional
        Called with the progress (0 to 1). An exception from it stops the work; nothing is kept.
    say : callable, optional
        Called with a line for each step.
    again : bool, optional
        Whether to make it in any case: its code has changed.

    Returns
    -------
    path : Path
        The calibration.

    Raises
    ------
    InputError
        If it cannot be written anywhere.
    """
    if not again and (path := prepared()) is not None:
        return path
    from gelpolight_core.calibration.calibration_file import write_calibration  # slow imports
    from gelpolight_core.calibration.project import run_calibration
    from gelpolight_core.lab.evaluation_run import measure_press
    from gelpolight_core.lab.reference_press import read_truth
    from gelpolight_core.lab.validation_trial import validate
    from gelpolight_core.reconstruction.reconstructor import Reconstructor
    from gelpolight_core.session.session import read_session
    from gelpolight_core.simulation.simulated_session import simulate_session

    design, line = virtual_design(), "Preparing the virtual sensor: {n} of 3, {step}"
    with tempfile.TemporaryDirectory(prefix="gelpolight-") as temporary:
        session = Path(temporary, design.serial)
        say(line.format(n=1, step="making its images"))
        simulate_session(
            design, session, progress=lambda _file, share: progress(IMAGES_SHARE * share)
        )
        say(line.format(n=2, step="calibrating"))
        calibration = run_calibration(
            read_session(session),
            progress=lambda _stage, share: progress(IMAGES_SHARE + (1 - IMAGES_SHARE) * share),
        ).calibration
        say(line.format(n=3, step="validating"))
        (press,) = read_truth(session / "presses").rows
        image = session / "presses" / press.file
        measured, _ = measure_press(image, press.truth, Reconstructor(calibration))
        presses = [replace(press, outcome=measured)]
        validation = validate(presses, calibration.identity, TOLERANCE_PERCENT)
    path = _new_path()
    write_calibration(replace(calibration, validation=validation), path)
    return path


def _new_path() -> Path:
    """Return the first path that can be written. What other versions made there is removed."""
    for folder in folders():
        path = _path_in(folder)
        try:
            make_folder(path.parent)
        except InputError as error:
            refusal = error
            continue
        for other in folder.iterdir():
            if other != path.parent:
                shutil.rmtree(other, ignore_errors=True)
        return path
    raise refusal
