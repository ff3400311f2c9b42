"""Cameras of this computer and of drivers that other packages bring."""

from __future__ import annotations

import logging

from gelpolight_core.base.plugins import CAMERAS, plug_ins

from .driver import CameraDevice, CameraDriver, CameraFormat, OpenCamera

_LOG = logging.getLogger(__name__)


class AllCameras:
    """The cameras of this computer, and of the drivers that installed packages bring.

    Parameters
    ----------
    ours : CameraDriver
        The driver of this computer's cameras.
    """

    def __init__(self, ours: CameraDriver) -> None:
        self._ours = ours
        self._others: dict[str, CameraDriver] = plug_ins(
            CAMERAS, lambda driver: driver.devices and driver.formats and driver.open
        )
        self._driver_of: dict[str, CameraDriver] = {}

    def devices(self) -> tuple[CameraDevice, ...]:
        """Return the connected cameras. A driver that fails is left out and logged."""
        devices = self._ours.devices()
        for name, driver in self._others.items():
            try:
                listed = tuple(driver.devices())
            except Exception as error:  # other people's code, which may fail in any way
                _LOG.warning("The cameras of the driver %s cannot be listed (%s)", name, error)
                continue
            devices += listed
            self._driver_of |= {device.identity: driver for device in listed}
        return devices

    def formats(self, device: CameraDevice) -> tuple[CameraFormat, ...]:
        """Return the formats that a camera lists."""
        return self._of(device).formats(device)

    def open(self, device: CameraDevice, wanted: CameraFormat | None) -> OpenCamera:
        """Open a camera with its own driver."""
        return self._of(device).open(device, wanted)

    def _of(self, device: CameraDevice) -> CameraDriver:
        return self._driver_of.get(device.identity, self._ours)
