"""``gelpolight cameras``: lists the connected cameras, their formats and settings."""

from __future__ import annotations

from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path

from app.sources.camera_drivers.camera_state import is_locked
from app.sources.camera_drivers.driver import (
    CameraDevice,
    CameraDriver,
    CameraFormat,
    best_format,
    compression_warning,
)
from app.sources.source import SourceSetting
from gelpolight_core.base.atomic_write import write_json
from gelpolight_core.base.errors import InputError

from .options import Command, result_option
from .terminal import escape_control, print_safe

CONTROL = ("value", "low", "high", "step", "unit")
"""Of each setting of a camera, in the file."""


@dataclass(frozen=True)
class CamerasCommand(Command):
    """The connected cameras."""

    json: Path | None = result_option()

    def run(self) -> None:
        """List the connected cameras."""
        from app.sources.camera_drivers.opencv import AllCameras, OpenCvDriver  # slow import

        report(AllCameras(OpenCvDriver()), self.json)


def report(driver: CameraDriver, json: Path | None) -> None:
    """Print every camera of a driver, and write the same as JSON if requested."""
    entries = []
    for device in driver.devices():
        formats, controls, trouble = _ask(driver, device)
        rows = [f"  {trouble}"] if trouble else [*_format_lines(formats), *_control_lines(controls)]
        head = f"{escape_control(device.name)}  [{device.identity}]  {device.address}"
        print_safe("\n".join([head, *rows]))
        entries.append(
            {
                "name": device.name,
                "identity": device.identity,
                "model": device.model,
                "place": device.address,
                "trouble": trouble or None,
                "formats": [{**asdict(f), "compressed": f.compressed} for f in formats],
                "controls": {c.key: {k: getattr(c, k) for k in CONTROL} for c in controls},
            }
        )
    if not entries:
        print_safe(
            "No camera was found, or this user has no access to it. Connect a camera. On Linux, "
            "check that /dev/video0 exists and add the user to the group video."
        )
    if json is not None:
        write_json(json, {"cameras": entries})


def _ask(
    driver: CameraDriver, device: CameraDevice
) -> tuple[tuple[CameraFormat, ...], tuple[SourceSetting, ...], str]:
    """Return formats and settings of a camera, or why they are unknown."""
    formats: tuple[CameraFormat, ...] = ()
    try:
        formats = driver.formats(device)
        with closing(driver.open(device, None)) as camera:
            return formats or (camera.format,), camera.controls(), ""
    except InputError as error:
        return formats, (), str(error)


def _format_lines(formats: tuple[CameraFormat, ...]) -> list[str]:
    best_of_all = best_format(formats)
    marks = ("*" if f == best_of_all else " " for f in formats)
    notes = (", compressed" if f.compressed else "" for f in formats)
    lines = [f"  {mark} {f}{note}" for mark, f, note in zip(marks, formats, notes, strict=True)]
    if best_of_all is not None and (warning := compression_warning(best_of_all, formats)):
        lines.append(f"  {warning}")
    return lines


def _control_lines(controls: tuple[SourceSetting, ...]) -> list[str]:
    if not controls:
        text = "The operating system does not allow programs to change the settings of this camera."
        return [f"    {text}"]
    lines = []
    for c in controls:
        extent = f"{c.low:g} to {c.high:g}"
        remark = "" if c.writable else "  (set by the camera)"
        value = f"{c.value:g} {c.unit}".rstrip()
        lines.append(f"    {c.key:<22}{c.label:<30}{value:>10}  {extent}{remark}".rstrip())
    if not is_locked(controls):
        lines.append("    Not locked: the camera still adjusts some settings automatically.")
    return lines
