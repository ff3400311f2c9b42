"""The one entry point, ``gelpolight``: reads the arguments and calls one command."""

from __future__ import annotations

import argparse
import logging
import os
import sys
import traceback
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import platformdirs

from app.command_line import (
    benchmark,
    calibrate,
    design,
    evaluate,
    inspect_calibration,
    measure,
    reconstruct,
    simulate,
)
from gelpolight_core import __version__
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

OUR_FAULT = 1
MENDABLE = 2
INTERRUPTED = 130
COMMANDS = (
    simulate,
    calibrate,
    inspect_calibration,
    reconstruct,
    measure,
    evaluate,
    benchmark,
    design,
)


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    parser = argparse.ArgumentParser(
        prog="gelpolight",
        description=tr("Calibrate a point-lit tactile sensor, see what it feels, and measure it."),
    )
    parser.add_argument("--version", action="version", version=f"gelpolight {__version__}")
    commands = parser.add_subparsers(title=tr("commands"), metavar=tr("COMMAND"))
    for command in COMMANDS:
        command.add_parser(commands)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    parser = build_parser()
    options = parser.parse_args(arguments)
    if not hasattr(options, "run"):
        parser.print_help()
        return 0
    try:
        status: int = options.run(options)
        sys.stdout.flush()
    except InputError as error:
        print(f"gelpolight: {error}", file=sys.stderr)
        return MENDABLE
    except KeyboardInterrupt:
        print(tr("gelpolight: stopped"), file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of our output has gone; nothing is left to say to it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception:  # the outermost edge: a technician sees one line, the log the whole of it
        print(_report_fault(), file=sys.stderr)
        return OUR_FAULT
    return status


def _report_fault() -> str:
    """Write the traceback to the log, and return the line that the person sees."""
    folder = Path(platformdirs.user_log_path("gelpolight"))
    text = f"{datetime.now(UTC).isoformat()} gelpolight {__version__}\n{traceback.format_exc()}\n"
    summary = str(sys.exc_info()[1]).splitlines()
    said = tr("gelpolight: a fault of this program ({what})").format(
        what=summary[0] if summary else sys.exc_info()[0].__name__  # type: ignore[union-attr]
    )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        log = folder / "faults.log"
        with log.open("a", encoding="utf-8") as stream:
            stream.write(text)
    except OSError:
        logging.getLogger("gelpolight").error("%s", text)
        return said
    return said + tr("; please report it with the log {log}").format(log=log)


if __name__ == "__main__":
    sys.exit(main())
