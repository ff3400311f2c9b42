"""GelPoLight: from images of a gel sensor to depth in millimetres.

``import gelpolight_core as gp`` gives the public interface:

- `simulate`, `calibrate`, `read_calibration`, `write_calibration`, `Calibration`, `SensorDesign`
- `read_image`, `Reconstructor`, `HeightMap`, `Flag`, `read_height_map`, `write_height_map`
- `measure`, `Measurement`
- `InputError`

All other modules are internal and may change at any time. Each name is loaded when it is first
used, so that the import itself takes no time.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gelpolight_core.base.version import __version__ as __version__

if TYPE_CHECKING:
    from gelpolight_core._api import (
        calibrate,
        measure,
        read_height_map,
        read_image,
        simulate,
        write_height_map,
    )
    from gelpolight_core.base.errors import InputError
    from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
    from gelpolight_core.measurement.result import Measurement
    from gelpolight_core.reconstruction.height_map import Flag, HeightMap
    from gelpolight_core.reconstruction.reconstructor import Reconstructor
    from gelpolight_core.sensor.sensor_calibration import Calibration
    from gelpolight_core.simulation.sensor_design import SensorDesign

__all__ = [
    "Calibration",
    "Flag",
    "HeightMap",
    "InputError",
    "Measurement",
    "Reconstructor",
    "SensorDesign",
    "calibrate",
    "measure",
    "read_calibration",
    "read_height_map",
    "read_image",
    "simulate",
    "write_calibration",
    "write_height_map",
]

_MODULES = {
    "Calibration": "sensor.sensor_calibration",
    "Flag": "reconstruction.height_map",
    "HeightMap": "reconstruction.height_map",
    "InputError": "base.errors",
    "Measurement": "measurement.result",
    "Reconstructor": "reconstruction.reconstructor",
    "SensorDesign": "simulation.sensor_design",
    "calibrate": "_api",
    "measure": "_api",
    "read_calibration": "calibration.calibration_file",
    "read_height_map": "_api",
    "read_image": "_api",
    "simulate": "_api",
    "write_calibration": "calibration.calibration_file",
    "write_height_map": "_api",
}


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names."""
    return [*__all__, "__version__"]
