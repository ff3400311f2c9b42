"""The parser of the command line: it loads a command only when that command is used."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from importlib import import_module
from typing import Any, NoReturn

from gelpolight_core import __version__
from gelpolight_core.translation import tr

MENDABLE = 2
"""Exit status for input that a person can correct."""
DEMO = "--demo"


class Parser(argparse.ArgumentParser):
    """A parser that reports an error in one line, like all commands."""

    def error(self, message: str) -> NoReturn:
        """Print what is wrong and where to find help, then exit."""
        advice = tr("See {command} --help").format(command=self.prog)
        self.exit(MENDABLE, f"{self.prog}: {message}. {advice}.\n")


class CommandParser(Parser):
    """The parser of one command; its module is imported when there is something to parse.

    Parameters
    ----------
    module : str
        Module in this package with ``add_arguments(parser)`` and ``run(options)``.
    **options
        Passed on to :class:`argparse.ArgumentParser`.
    """

    def __init__(self, *, module: str = "", **options: Any) -> None:
        super().__init__(**options)
        self._module = module

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Add the command's own arguments, then parse."""
        if self._module:
            module = import_module(f"app.command_line.{self._module}")
            self._module = ""
            module.add_arguments(self)
            self.set_defaults(run=module.run)
        return super().parse_known_args(args, namespace)


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    parser = Parser(
        prog="gelpolight",
        description=tr(
            "Calibrate a point-lit tactile sensor, see its depth map, and measure "
            "objects. Without a command the desktop program starts."
        ),
    )
    parser.add_argument("--version", action="version", version=f"gelpolight {__version__}")
    parser.add_argument(
        DEMO, action="store_true", help=tr("start the desktop program on the virtual sensor")
    )
    commands = parser.add_subparsers(
        title=tr("commands"), metavar=tr("COMMAND"), parser_class=CommandParser
    )
    for name, module, summary in _commands():
        commands.add_parser(name, help=summary, module=module)
    return parser


def _commands() -> tuple[tuple[str, str, str], ...]:
    """Return name, module and summary of each command, in the order of the help text."""
    return (
        ("simulate", "simulate", tr("create a session folder of the virtual sensor")),
        ("calibrate", "calibrate", tr("create a calibration from a session folder")),
        (
            "import",
            "import_folder",
            tr("turn a calibration folder of another library into a closed sensor's session"),
        ),
        ("inspect", "inspect_calibration", tr("show the content of a calibration or a recording")),
        ("reconstruct", "reconstruct", tr("turn images and recordings into depth maps in mm")),
        (
            "batch",
            "batch",
            tr("turn recordings and folders of any size into depth maps, on many cores"),
        ),
        ("measure", "measure", tr("measure the pressed object, or apply a measuring tool")),
        ("profile", "profile", tr("write the depth along a line as CSV")),
        ("evaluate", "evaluate", tr("compare measured presses with their true values")),
        ("records", "records", tr("list earlier measurements, or write them as CSV")),
        ("refresh", "refresh", tr("a closed sensor's calibration after its gel was changed")),
        (
            "drift",
            "drift",
            tr("compare an image of the untouched sensor with the calibration's background"),
        ),
        ("report", "report", tr("write a calibration's report as PDF")),
        ("benchmark", "benchmark", tr("show the processing time of each step of a frame")),
        ("work-precision", "work_precision", tr("show error against run time")),
        ("stability", "stability", tr("run extreme cases")),
        ("design", "design", tr("check a sensor design before it is built")),
        ("board", "board", tr("create a checkerboard to print, A4 at true size")),
        ("cameras", "cameras", tr("list the connected cameras, their formats and settings")),
    )
