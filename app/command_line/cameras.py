"""``gelpolight cameras``: lists the connected cameras, their formats and settings."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

from app.command_line.terminal import harmless, say
from app.sources.camera.applying import is_locked
from app.sources.camera.driver import CameraDriver, Device, Format, best_format, compression_warning
from app.sources.source import Setting
from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import write_json
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("--json", type=Path, metavar="FILE")


def run(options: argparse.Namespace) -> int:
    """List the connected cameras."""
    from app.sources.camera.opencv import OpenCvDriver  # slow import

    return report(OpenCvDriver(), options.json)


def report(driver: CameraDriver, json: Path | None) -> int:
    """Print every camera of a driver, and write the same as JSON if requested."""
    found = []
    for device in driver.devices():
        formats, controls, trouble = _ask(driver, device)
        say("\n".join(_lines(device, formats, controls, trouble)))
        found.append(_entry(device, formats, controls, trouble))
    if not found:
        say(
            tr(
                "No camera was found, or this user has no access to it. Connect a camera. "
                "On Linux, check that /dev/video0 exists and add the user to the group "
                "video."
            )
        )
    if json is not None:
        write_json(json, {"cameras": found})
    return 0


def _ask(
    driver: CameraDriver, device: Device
) -> tuple[tuple[Format, ...], tuple[Setting, ...], str]:
    """Return formats and settings of a camera, or why they are unknown."""
    try:
        formats = driver.formats(device)
        camera = driver.open(device, None)
    except InputError as error:
        return (), (), str(error)
    try:
        return formats or (camera.format,), camera.controls(), ""
    except InputError as error:
        return formats, (), str(error)
    finally:
        camera.close()


def _lines(
    device: Device, formats: tuple[Format, ...], controls: tuple[Setting, ...], trouble: str
) -> list[str]:
    lines = [f"{harmless(device.name)}  [{device.identity}]  {device.address}"]
    if trouble:
        return [*lines, f"  {trouble}"]
    best = best_format(formats)
    for f in formats:
        note = tr(", compressed") if f.compressed else ""
        lines.append(f"  {'*' if f == best else ' '} {f}{note}")
    if best is not None and (warning := compression_warning(best, formats)):
        lines.append(f"  {warning}")
    for c in controls:
        extent = tr("{low:g} to {high:g}").format(low=c.low, high=c.high)
        remark = "" if c.writable else tr("  (set by the camera)")
        value = f"{c.value:g} {c.unit}".rstrip()
        lines.append(f"    {c.key:<22}{c.label:<30}{value:>10}  {extent}{remark}".rstrip())
    if not controls:
        lines.append(
            tr(
                "    The operating system does not allow programs to change the settings of this "
                "camera."
            )
        )
    elif not is_locked(controls):
        lines.append(tr("    Not locked: the camera still adjusts some settings automatically."))
    return lines


def _entry(
    device: Device, formats: tuple[Format, ...], controls: tuple[Setting, ...], trouble: str
) -> dict[str, Any]:
    return {
        "name": device.name,
        "identity": device.identity,
        "model": device.model,
        "place": device.address,
        "trouble": trouble or None,
        "formats": [{**asdict(f), "compressed": f.compressed} for f in formats],
        "controls": {
            c.key: {"value": c.value, "low": c.low, "high": c.high, "step": c.step, "unit": c.unit}
            for c in controls
        },
    }
