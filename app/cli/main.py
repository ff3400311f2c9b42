"""The entry point of ``gelpolight``: reads the arguments and calls one command."""

from __future__ import annotations

import os
import sys
import tempfile
import traceback
import warnings
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import cache, partial
from pathlib import Path
from typing import TextIO

import platformdirs

from gelpolight_core.base.errors import InputError, Remedy, as_input_error
from gelpolight_core.base.version import __version__

from .parser import DEMO, MENDABLE, build_parser
from .terminal import print_safe

OUR_FAULT = 1
INTERRUPTED = 130
LOG = "gelpolight-faults.log"
OPENED = (".gplcal", ".gplrec")
"""Extensions of the files that a desktop opens with this program."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    _open_closed_streams()
    # Before NumPy is loaded: the program distributes its work itself. Further threads, which wait
    # for small matrices in busy loops, would use up the cores.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    warnings.showwarning = _log_warning
    try:
        status = _run(sys.argv[1:] if arguments is None else list(arguments))
        sys.stdout.flush()
    except InputError as error:
        print_safe(f"gelpolight: {error}", file=sys.stderr)
        return MENDABLE
    except KeyboardInterrupt:
        print_safe("gelpolight: Stopped", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of our output has closed the pipe, so nothing more can be written.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:  # the user sees one line, the log gets the traceback
        if fault := as_input_error(error):
            _write_log(traceback.format_exc())
            print_safe(f"gelpolight: {fault}", file=sys.stderr)
            return MENDABLE
        print_safe(_report_fault(), file=sys.stderr)
        return OUR_FAULT
    return status


def _run(arguments: list[str]) -> int:
    """Run a command, or show the main window, which can open files."""
    files = [Path(text) for text in arguments]
    if all(file.suffix.lower() in OPENED for file in files):
        for file in files:
            if not file.is_file():
                raise InputError("The file does not exist", file, Remedy.CHECK_NAME)
        return _open_desktop(arguments)
    parsed = build_parser().parse_args(arguments)
    if parsed.command is None:
        return _open_desktop([DEMO])
    command = parsed.command.of(parsed)
    command.check_files()
    return command.run() or 0


def _open_desktop(arguments: list[str]) -> int:
    """Show the main window. Imported here, because commands also run without window libraries."""
    try:
        from app.window.desktop import run
    except ModuleNotFoundError as error:
        raise InputError(
            "The desktop program is not installed, only the library and the commands",
            str(error),
            Remedy.INSTALL.format(package="gelpolight-studio[gui]"),
        ) from error
    return run(arguments)


def _open_closed_streams() -> None:
    """Replace a closed output (``>&-``), because progress bars must write somewhere."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))


def _report_fault() -> str:
    """Write the traceback to the log, and return the line for the user."""
    summary = str(sys.exc_info()[1]).splitlines()
    reason = summary[0] if summary else sys.exc_info()[0].__name__  # type: ignore[union-attr]
    log = _write_log(traceback.format_exc())
    if log is None:
        return f"gelpolight: Internal error ({reason})"
    return f"gelpolight: Internal error ({reason}). Please report it and include the log {log}"


def _log_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Write a library's warning to the log: it does not help the user."""
    _write_log(warnings.formatwarning(message, category, filename, lineno, line))


def _write_log(text: str) -> Path | None:
    """Append to the log, in the temporary folder if necessary, and return its path."""
    entry = f"{datetime.now(UTC).isoformat()} gelpolight {__version__}\n{text}\n"
    user_folder = partial(platformdirs.user_log_path, "gelpolight", ensure_exists=True)
    for make_folder in (user_folder, _private_folder):
        try:
            log = make_folder() / LOG
            with log.open("a", encoding="utf-8") as stream:
                stream.write(entry)
        except OSError:  # a full disk or a read-only home folder
            continue
        return log
    return None


@cache
def _private_folder() -> Path:
    """Return a new temporary folder, in which nobody else can have placed a link."""
    return Path(tempfile.mkdtemp(prefix="gelpolight-log-"))


if __name__ == "__main__":
    sys.exit(main())
