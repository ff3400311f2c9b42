"""Finished measurements, one line each, so that no press is measured twice.

The key of a line contains everything that its result depends on: the bytes of the image, the shape
and stated edge of the object, and the name of the ledger (calibration, model, program version). An
image that was captured again, or another calibration, therefore never gets an old result.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from gelpolight_core.finding import doubt
from gelpolight_core.io.atomic import append_json
from gelpolight_core.io.reading import json_lines, plain_text
from gelpolight_core.io.texts import text_of_file
from gelpolight_core.measurement.evaluation_run import Outcome, outcome_of
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.reference import Truth


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
        for _, line in json_lines(path):
            self._take_in(line)

    def outcome(
        self, image: Path, truth: Truth, measure: Callable[[Path, Truth], Outcome]
    ) -> Outcome:
        """Return the result of an image, which is measured and kept if it is not known.

        Parameters
        ----------
        image : Path
            The press.
        truth : Truth
            What is pressed.
        measure : callable (image, Truth) -> Measurement
            As for :func:`~gelpolight_core.measurement.evaluation_run.evaluate_presses`.

        Raises
        ------
        InputError
            If the file of the ledger cannot be written.
        """
        key = self.key(image, truth)
        known = None if key is None else self.find(key)
        if known is not None:
            return known
        outcome = outcome_of(measure, image, truth)
        if key is not None:
            self.keep(key, outcome)
        return outcome

    def key(self, image: Path, truth: Truth) -> str | None:
        """Return what an image's result is found by; None where the image cannot be read."""
        try:
            content = image.read_bytes()
        except OSError:  # the measurement itself reports this error
            return None
        digest = hashlib.sha256(content)
        edge = truth.edge_mm
        stated = "" if edge[0] is None else f"\n{edge}"
        digest.update(f"\n{truth.shape}\n{self._name}{stated}".encode())
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
        plain = outcome if isinstance(outcome, str) else _as_json(outcome)
        append_json(self._path, [{"key": key, "outcome": plain}])

    def _take_in(self, content: Any) -> None:
        """Read one line; the press of an invalid line is measured again."""
        try:
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


def _as_json(measurement: Measurement) -> dict[str, Any]:
    """Return all fields; JSON writes numbers so that they are read back exactly."""
    plain = asdict(measurement)
    plain["outline_mm"] = measurement.outline_mm.tolist()
    del plain["findings"]
    return plain | {"verdict": measurement.verdict, "reason": measurement.reason}


def _measurement(content: dict[str, Any]) -> Measurement:
    values = {key: _restored(value) for key, value in content.items()}
    for part in ("sd", "noise_sd", "calibration_sd", "mode_sd"):
        if not isinstance(values.get(part), dict | None):
            raise TypeError(f"{part} is no table")
    del values["verdict"]
    reason = text_of_file(values.pop("reason"))
    values["findings"] = (doubt("stored", reason),) if reason else ()
    values["outline_mm"] = np.array(content["outline_mm"], np.float64)
    return Measurement(**values)


def _restored(value: Any) -> Any:
    """Return a value of JSON with tuples in place of lists."""
    if isinstance(value, dict):
        return {key: _restored(part) for key, part in value.items()}
    return tuple(value) if isinstance(value, list) else value
