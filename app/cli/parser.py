"""The parser of the command line: it loads a command only when that command is used."""

from __future__ import annotations

import argparse
import re
from collections.abc import Collection, Sequence
from importlib import import_module
from typing import Any, NoReturn

from gelpolight_core.base.version import __version__

MENDABLE = 2
"""Exit status for input that a person can correct."""
DEMO = "--demo"


class Parser(argparse.ArgumentParser):
    """A parser that reports an error in one line, like all commands."""

    def error(self, message: str) -> NoReturn:
        """Print the error with a hint at the help, then exit."""
        advice = f"See {self.prog} --help"
        self.exit(MENDABLE, f"{self.prog}: {message}. {advice}.\n")


class CommandParser(Parser):
    """The parser of one command, which is imported when there is something to parse.

    Parameters
    ----------
    command : str
        Module in this package and class, as ``measure.MeasureCommand``.
    **options
        Passed on to :class:`argparse.ArgumentParser`.
    """

    def __init__(self, *, command: str, **options: Any) -> None:
        super().__init__(**options)
        self._command = command
        self._pairs = set[str]()

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Add the command's own arguments, then parse."""
        if self._command:
            module, _, name = self._command.partition(".")
            command = getattr(import_module(f"app.cli.{module}"), name)
            self._command = ""
            self._pairs = command.add_arguments(self)
            self.set_defaults(command=command)
        return super().parse_known_args(separated(args or (), self._pairs), namespace)


def separated(arguments: Sequence[str], pairs: Collection[str]) -> list[str]:
    """Return arguments with the two values of ``--from -5,2`` apart, but not ``--square 2,5``.

    A negative value gets a blank, which tells argparse that it is no option.
    """
    parts: list[str] = []
    for before, text, after in zip(("", *arguments), arguments, (*arguments[1:], ""), strict=False):
        is_pair_alone = before in pairs and not _NUMBER.fullmatch(after)
        parts += text.split(",") if is_pair_alone and _PAIR.fullmatch(text) else [text]
    values = _NUMBER, _PAIR
    return [
        f" {part}" if part[:1] == "-" and any(kind.fullmatch(part) for kind in values) else part
        for part in parts
    ]


_NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?", re.IGNORECASE)
_PAIR = re.compile(r"[-+\d.e]+,[-+\d.e]+", re.IGNORECASE)


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of all commands. The result has the class of the `command`, or None."""
    parser = Parser(
        prog="gelpolight",
        description=(
            "Calibrate a point-lit tactile sensor, see its depth map, and measure "
            "objects. Without a command the desktop program starts."
        ),
    )
    parser.set_defaults(command=None)
    parser.add_argument("--version", action="version", version=f"gelpolight {__version__}")
    parser.add_argument(
        DEMO, action="store_true", help="start the desktop program on the virtual sensor"
    )
    commands = parser.add_subparsers(
        title="commands", metavar="COMMAND", parser_class=CommandParser
    )
    for command, summary in _commands().items():
        words = re.findall(r"[A-Z][a-z]+", command.partition(".")[2].removesuffix("Command"))
        name = "-".join(words).lower()
        commands.add_parser(name, help=summary, command=command)
    return parser


def _commands() -> dict[str, str]:
    """Return the summary of each command by its module and class, in the order of the help."""
    return {
        "design.SimulateCommand": "create a session folder of the virtual sensor",
        "calibrate.CalibrateCommand": "create a calibration from a session folder",
        "calibrate.ImportCommand": (
            "turn a calibration folder of another library into a closed sensor's session"
        ),
        "inspect_file.InspectCommand": "show the content of a calibration or a recording",
        "reconstruct.ReconstructCommand": "turn images and recordings into depth maps in mm",
        "batch.BatchCommand": (
            "turn recordings and folders of any size into depth maps, on many cores"
        ),
        "measure.MeasureCommand": "measure the pressed object",
        "reconstruct.ProfileCommand": "write the depth along a line as CSV",
        "studies.EvaluateCommand": "compare measured presses with their true values",
        "records.RecordsCommand": "list earlier measurements, or write them as CSV",
        "calibrate.RefreshCommand": "a closed sensor's calibration after its gel was changed",
        "calibrate.ExportNormalsCommand": (
            "write a closed sensor's normals by colour and place, for other programs"
        ),
        "calibrate.DriftCommand": (
            "compare an image of the untouched sensor with the calibration's background"
        ),
        "report.ReportCommand": "write a calibration's report as PDF",
        "reconstruct.BenchmarkCommand": "show the processing time of each step of a frame",
        "studies.WorkPrecisionCommand": "show error against run time",
        "studies.StabilityCommand": "run extreme cases",
        "design.DesignCommand": "check a sensor design before it is built",
        "board.BoardCommand": "create a checkerboard to print, A4 at true size",
        "cameras.CamerasCommand": "list the connected cameras, their formats and settings",
    }
