"""Finished measurements, one line each, so that no press is measured twice.

The key of a line contains everything that its result depends on: the bytes of the image, the shape,
and the name of the ledger (calibration, model, program version). An image that was captured again,
or another calibration, therefore never gets an old result.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.atomic import append_durably
from gelpolight_core.io.reading import parse_json, plain_text, read_file
from gelpolight_core.io.texts import text_of_file
from gelpolight_core.measurement.evaluation_run import Outcome, outcome_of
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.translation import english, tr

SIZE_LIMIT = 100_000_000


class Ledger:
    """A file of measurements. Each line is on the disk before the next one begins.

    Parameters
    ----------
    path : Path
        The file, made with the first line.
    name : str
        What else the results depend on, such as the calibration's identity and the model.

    Raises
    ------
    InputError
        If the file is there and cannot be read.
    """

    def __init__(self, path: Path, name: str) -> None:
        self._path, self._name = path, name
        self._known: dict[str, Outcome] = {}
        try:
            lines = read_file(path, SIZE_LIMIT).decode().split("\n")
        except FileNotFoundError:
            return
        except UnicodeDecodeError as error:
            raise _damaged(path) from error
        for line in lines:
            self._take_in(line)

    def outcome(self, image: Path, shape: str, measure: Callable[[Path, str], Outcome]) -> Outcome:
        """Return the result of an image, which is measured and kept if it is not known.

        Parameters
        ----------
        image : Path
            The press.
        shape : str
            What is pressed.
        measure : callable (image, shape) -> Measurement
            As for :func:`~gelpolight_core.measurement.evaluation_run.evaluate_presses`.

        Raises
        ------
        InputError
            If the file of the ledger cannot be written.
        """
        key = self.key(image, shape)
        known = None if key is None else self.find(key)
        if known is not None:
            return known
        outcome = outcome_of(measure, image, shape)
        if key is not None:
            self.keep(key, outcome)
        return outcome

    def key(self, image: Path, shape: str) -> str | None:
        """Return what an image's result is found by; None where the image cannot be read."""
        try:
            content = image.read_bytes()
        except OSError:  # the measurement itself reports this error
            return None
        digest = hashlib.sha256(content)
        digest.update(f"\n{shape}\n{self._name}".encode())
        return digest.hexdigest()

    def find(self, key: str) -> Outcome | None:
        """Return a result: a measurement, a sentence why there is none, or None if not known."""
        return self._known.get(key)

    def keep(self, key: str, outcome: Outcome) -> None:
        """Write a result to the end of the file.

        Raises
        ------
        InputError
            If the file cannot be written.
        """
        self._known[key] = outcome
        plain = english(outcome) if isinstance(outcome, str) else _as_json(outcome)
        line = json.dumps({"key": key, "outcome": plain}, separators=(",", ":")) + "\n"
        append_durably(self._path, line.encode())

    def _take_in(self, line: str) -> None:
        """Read one line; the press of an incomplete line is measured again."""
        try:
            content = parse_json(line)
            outcome = content["outcome"]
            fitted = isinstance(outcome, dict) and "shape" in outcome
            self._known[content["key"]] = _measurement(outcome) if fitted else _failure(outcome)
        except (ValueError, TypeError, KeyError, AttributeError, ArithmeticError):
            return


def _failure(outcome: Any) -> str:
    """Return the sentence why an image has no measurement."""
    text = text_of_file(outcome)
    plain_text(str(text))
    return text


def _damaged(path: Path) -> InputError:
    return InputError(tr("the file is not text in UTF-8"), where=path, advice=Remedy.REPAIR_FILE)


def _as_json(measurement: Measurement) -> dict[str, Any]:
    """Return all fields; JSON writes numbers so that they are read back exactly."""
    plain = asdict(measurement)
    plain["outline_mm"] = measurement.outline_mm.tolist()
    plain["reason"] = english(measurement.reason)
    return plain


def _measurement(content: dict[str, Any]) -> Measurement:
    values = {key: _restored(value) for key, value in content.items()}
    for part in ("sd", "noise_sd", "calibration_sd", "mode_sd"):
        if not isinstance(values.get(part), dict | None):
            raise TypeError(f"{part} is no table")
    values["reason"] = text_of_file(content["reason"])
    values["outline_mm"] = np.array(content["outline_mm"], np.float64)
    return Measurement(**values)


def _restored(value: Any) -> Any:
    """Return a value of JSON with tuples in place of lists."""
    if isinstance(value, dict):
        return {key: _restored(part) for key, part in value.items()}
    return tuple(value) if isinstance(value, list) else value
