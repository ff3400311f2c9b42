"""The one entry point, ``gelpolight``: reads the arguments and calls one command."""

from __future__ import annotations

import argparse
import os
import re
import sys
import tempfile
import traceback
import warnings
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import NoReturn, TextIO

import platformdirs

from app.command_line.terminal import say
from gelpolight_core import __version__
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

OUR_FAULT = 1
MENDABLE = 2
INTERRUPTED = 130
LOG = "gelpolight-faults.log"
DEMO = "--demo"
OPENED = (".gplcal", ".gplrec")
"""Endings of the files that a desktop opens with this program."""


class _Parser(argparse.ArgumentParser):
    """A parser that refuses in one line, as everything else here does."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and where help is, and leave."""
        advice = tr("See {command} --help").format(command=self.prog)
        self.exit(MENDABLE, f"{self.prog}: {message}. {advice}.\n")


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    # Not above: they load for seconds, and Ctrl-C shall be answered in that time too.
    from app.command_line import (
        ablation,
        batch,
        benchmark,
        board,
        calibrate,
        cameras,
        design,
        drift,
        evaluate,
        inspect_calibration,
        measure,
        profile,
        protocol,
        reconstruct,
        records,
        report,
        simulate,
        stability,
        work_precision,
    )

    parser = _Parser(
        prog="gelpolight",
        description=tr(
            "Calibrate a point-lit tactile sensor, see what it feels, and measure it. "
            "Without a command the desktop program starts."
        ),
    )
    parser.add_argument("--version", action="version", version=f"gelpolight {__version__}")
    parser.add_argument(
        DEMO, action="store_true", help=tr("start the desktop program on the virtual sensor")
    )
    parser.set_defaults(run=_open_desktop, files=())
    commands = parser.add_subparsers(title=tr("commands"), metavar=tr("COMMAND"))
    for command in (
        simulate,
        calibrate,
        inspect_calibration,
        reconstruct,
        batch,
        measure,
        profile,
        evaluate,
        records,
        drift,
        protocol,
        report,
        benchmark,
        ablation,
        work_precision,
        stability,
        design,
        board,
        cameras,
    ):
        command.add_parser(commands)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    _open_closed_streams()
    warnings.showwarning = _log_warning
    try:
        given = _split_places(sys.argv[1:] if arguments is None else list(arguments))
        # The window is up before the commands, which it does not need, would be loaded.
        options = _window(given) or build_parser().parse_args(given)
        status: int = options.run(options)
        sys.stdout.flush()
    except InputError as error:
        say(f"gelpolight: {error}", file=sys.stderr)
        return MENDABLE
    except KeyboardInterrupt:
        say(tr("gelpolight: stopped"), file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of our output has gone; nothing is left to say to it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:  # a name too long, no permission, a full disk
        say(_environment_fault(error), file=sys.stderr)
        return MENDABLE
    except Exception:  # the outermost edge: a technician sees one line, the log the whole of it
        say(_report_fault(), file=sys.stderr)
        return OUR_FAULT
    return status


def _open_desktop(options: argparse.Namespace) -> int:
    """Show the main window; here, because the commands run where no window library is."""
    from app.desktop import run

    return run([DEMO] if options.demo else [str(file) for file in options.files])


def _window(given: list[str]) -> argparse.Namespace | None:
    """Return the options of the window, None where a command is given.

    Raises
    ------
    InputError
        If a file to open is not there.
    """
    if given in ([], [DEMO]):
        return argparse.Namespace(run=_open_desktop, demo=bool(given), files=())
    files = tuple(Path(text) for text in given)
    if any(file.suffix.lower() not in OPENED for file in files):
        return None
    for file in files:
        if not file.is_file():
            raise InputError(
                tr("there is no such file"), where=str(file), advice=tr("Check its name")
            )
    return argparse.Namespace(run=_open_desktop, demo=False, files=files)


def _split_places(arguments: list[str]) -> list[str]:
    """Split places such as ``-1,2``, which would be taken for an option, into two numbers."""
    return [
        part
        for argument in arguments
        for part in (argument.split(",") if _PLACE.fullmatch(argument) else [argument])
    ]


_PLACE = re.compile(r"-\d*\.?\d+(,-?\d*\.?\d+)+")


def _open_closed_streams() -> None:
    """Give a program whose output is closed (``>&-``) somewhere to write, as progress bars do."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))


def _environment_fault(error: OSError) -> str:
    """Log the traceback, and return the line that the person sees."""
    _write_log(traceback.format_exc())
    found = InputError(
        tr("the system refuses it ({reason})").format(reason=error.strerror or error),
        where=str(error.filename or tr("files")),
        advice=tr("Check the name, the permissions and the disk"),
    )
    return f"gelpolight: {found}"


def _report_fault() -> str:
    """Write the traceback to the log, and return the line that the person sees."""
    summary = str(sys.exc_info()[1]).splitlines()
    said = tr("gelpolight: a fault of this program ({what})").format(
        what=summary[0] if summary else sys.exc_info()[0].__name__  # type: ignore[union-attr]
    )
    log = _write_log(traceback.format_exc())
    return (
        said if log is None else said + tr("; please report it with the log {log}").format(log=log)
    )


def _log_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Put a library's warning into the log: it tells a technician nothing."""
    _write_log(warnings.formatwarning(message, category, filename, lineno, line))


def _write_log(text: str) -> Path | None:
    """Add to the log, in the temporary folder where need be, and return its place."""
    entry = f"{datetime.now(UTC).isoformat()} gelpolight {__version__}\n{text}\n"
    for folder in (platformdirs.user_log_path("gelpolight"), Path(tempfile.gettempdir())):
        log = folder / LOG
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with log.open("a", encoding="utf-8") as stream:
                stream.write(entry)
        except OSError:  # a full disk, a home that can only be read
            continue
        return log
    return None


if __name__ == "__main__":
    sys.exit(main())
