"""What frames and validations say of a sensor over time: a file beside its calibrations.

    sensors/SERIAL/trend.jsonl

One line for each look at the untouched membrane, and for each validation. Lines are only appended,
so that several programs can write them.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from itertools import chain, repeat
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.channels import CHANNEL_KEYS, channel_name
from gelpolight_core.finding import Finding, Verdict
from gelpolight_core.io.atomic import append_json, make_folder
from gelpolight_core.io.reading import json_lines, plain_text
from gelpolight_core.lab.drift import LEAST_DAYS, Line, drifts
from gelpolight_core.light.finding import StateChange
from gelpolight_core.light.judging import ALONE, BLUR_PX, GAIN, SHIFT_PX
from gelpolight_core.validation import Validation

Array = NDArray[np.float64]
FILE = "trend.jsonl"
DAY_S = 86_400.0
MONTH_DAYS = 365.25 / 12.0
FARTHEST_DAYS = 3652
"""Later dates are not stated: ten years."""
LED_PERCENT = 100.0 * ALONE * GAIN
"""Change of the light of one LED that a check of an image calls a fault."""
OF_FRAMES = (*(f"light_{key}" for key in CHANNEL_KEYS), "shift_u", "shift_v", "blur")
"""Keys of the values of a :class:`~gelpolight_core.light.finding.StateChange`."""


@dataclass(frozen=True, slots=True)
class Followed:
    """A value that is followed over time.

    Attributes
    ----------
    key : str
        Name in files.
    name : str
        Name on the screen.
    unit : str
        Of the value.
    limit : float
        From which on it is a fault, without its sign.
    remedy : str
        What to do when it drifts.
    """

    key: str
    name: str
    unit: str
    limit: float
    remedy: str


def followed(size_percent: float, height_percent: float) -> dict[str, tuple[Followed, ...]]:
    """Return what is followed, in groups of one kind that are shown together.

    Parameters
    ----------
    size_percent, height_percent : float
        Largest errors that pass a validation.
    """
    again = "Set to zero, or calibrate again"
    led = f"Check the current and the cable of this LED. {again}"
    seat = f"Seat the camera and the elastomer firmly. {again}"
    clean = f"Clean the lens and check its focus. {again}"
    press = "Press another object to confirm it, then calibrate again"
    light = "Light of the {name} LED"
    return {
        "Light": tuple(
            Followed(f"light_{key}", light.format(name=channel_name(k)), "%", LED_PERCENT, led)
            for k, key in enumerate(CHANNEL_KEYS)
        ),
        "Shift": (
            Followed("shift_u", "Shift to the right", "px", SHIFT_PX, seat),
            Followed("shift_v", "Shift downwards", "px", SHIFT_PX, seat),
        ),
        "Blur": (Followed("blur", "Variance of the blur", "px²", BLUR_PX**2, clean),),
        "Validation": (
            Followed("size_error", "Error of the size", "%", size_percent, press),
            Followed("height_error", "Error of the height", "%", height_percent, press),
        ),
    }


@dataclass(frozen=True, slots=True)
class Sample:
    """What was seen of a sensor at one time.

    Attributes
    ----------
    time : datetime
        With its zone.
    calibration : str
        Identity of the calibration from which the changes count.
    values : mapping of str to (float, float)
        Value and standard deviation by the key of :class:`Followed`.
    """

    time: datetime
    calibration: str
    values: Mapping[str, tuple[float, float]]


def sample_of_frames(changes: Sequence[StateChange], calibration: str, time: datetime) -> Sample:
    """Return the mean of frames of an untouched membrane, with the deviation of a single one.

    Frames that follow each other share much of their deviation.
    """
    values = np.mean([change.values for change in changes], axis=0).tolist()
    sds = np.sqrt(np.mean([change.sd**2 for change in changes], axis=0)).tolist()
    return Sample(
        time, calibration, dict(zip(OF_FRAMES, zip(values, sds, strict=True), strict=True))
    )


def sample_of_validation(validation: Validation) -> Sample:
    """Return the errors of a validation: that of the height, and the largest one of a size."""
    errors = {c.name: c.error_percent or 0.0 for c in validation.comparisons}
    height = errors.pop("height", math.nan)
    size = max(errors.values(), key=abs, default=math.nan)
    values = {"size_error": (size, 0.0), "height_error": (height, 0.0)}
    return Sample(datetime.fromisoformat(validation.when), validation.identity, values)


def keep_sample(sample: Sample, folder: Path) -> None:
    """Write what was seen to the end of the file in a sensor's folder.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    known = {key: pair for key, pair in sample.values.items() if np.isfinite(pair).all()}
    if known:
        make_folder(folder)
        head = {"time": sample.time.isoformat(), "calibration": sample.calibration}
        append_json(folder / FILE, [{**head, "values": known}])


def read_samples(folder: Path) -> tuple[Sample, ...]:
    """Return what was seen of a sensor; a damaged line is left out.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    return tuple(filter(None, (_sample(content) for _, content in json_lines(folder / FILE))))


def _sample(content: Any) -> Sample | None:
    try:
        values = {plain_text(k): (float(v), float(sd)) for k, (v, sd) in content["values"].items()}
        time = datetime.fromisoformat(content["time"]).astimezone(UTC)
        return Sample(time, plain_text(content["calibration"]), values)
    except (ValueError, TypeError, KeyError, AttributeError):
        return None


@dataclass(frozen=True, slots=True)
class Course:
    """How a value has changed, day by day.

    Attributes
    ----------
    followed : Followed
        What it is.
    days, values, sds : (n,) float64
        Days since 1970-01-01 (UTC), mean of each day, its standard deviation.
    line : Line or None
        The change; None for less than :data:`LEAST_DAYS` days.
    """

    followed: Followed
    days: Array
    values: Array
    sds: Array
    line: Line | None

    @property
    def finding(self) -> Finding:
        """The change of a month, and when the limit will be reached."""
        key, unit = f"{self.followed.key}_drift", self.followed.unit
        judged = partial(Finding, key, unit=f"{unit}/month")
        name, line = self.followed.name, self.line
        if line is None:
            text = "{name}: too few days with values: {n} more are needed"
            return judged(text.format(name=name, n=LEAST_DAYS - len(self.days)))
        change, expanded = MONTH_DAYS * line.per_day, 2.0 * MONTH_DAYS * line.per_day_sd
        digits = max(1 - math.floor(math.log10(expanded)), 0) if expanded else 0
        day, earliest, latest = line.reaches(self.followed.limit)
        values = {
            "name": name,
            "change": f"{change:+.{digits}f} \N{PLUS-MINUS SIGN} {expanded:.{digits}f} {unit}",
            "limit": f"{self.followed.limit:.2g} {unit}",
            "day": date_text(day, line.last_day),
            "first": date_text(earliest, line.last_day),
            "last": date_text(latest, line.last_day),
        }
        if not line.alarm:
            text = "{name}: no drift ({change} a month); {limit} not before {first}"
            return judged(text.format(**values), change)
        text = (
            "{name} drifts by {change} a month; the limit of {limit} is reached on {day} "
            "({first} to {last})"
        )
        if day <= line.last_day:
            text = "{name} drifts by {change} a month; the limit of {limit} was reached on {day}"
        remedy = self.followed.remedy
        return judged(text.format(**values), change, verdict=Verdict.WARN, remedy=remedy)


def date_text(day: float, today: float) -> str:
    """Return a day since 1970-01-01 as a date."""
    if day - today > FARTHEST_DAYS:
        return "ten years from now"
    return f"{datetime.fromtimestamp(DAY_S * day, UTC).astimezone():%Y-%m-%d}"


def courses(
    samples: Sequence[Sample], calibration: str, group: tuple[Followed, ...]
) -> tuple[Course, ...]:
    """Return how the values of a group have changed; none where nothing was seen.

    Parameters
    ----------
    samples : sequence of Sample
        Of one sensor.
    calibration : str
        Identity of the calibration since which changes of frames count. Errors of a validation
        count with every calibration.
    group : tuple of Followed
        One group of :func:`followed`. Values of frames share their scatter.
    """
    if group[0].key not in OF_FRAMES:
        return tuple(chain.from_iterable(_courses(samples, (one,)) for one in group))
    return _courses([s for s in samples if s.calibration == calibration], group)


def drifting(
    samples: Sequence[Sample], calibration: str, limits_percent: tuple[float, float]
) -> tuple[Finding, ...]:
    """Return the drifts of a sensor that chance does not explain.

    Parameters
    ----------
    samples, calibration
        As for :func:`courses`.
    limits_percent : (float, float)
        As for :func:`followed`.
    """
    found = [
        course.finding
        for group in followed(*limits_percent).values()
        for course in courses(samples, calibration, group)
    ]
    return tuple(finding for finding in found if finding.verdict is Verdict.WARN)


def _courses(samples: Sequence[Sample], group: tuple[Followed, ...]) -> tuple[Course, ...]:
    by_day: dict[int, list[list[tuple[float, float]]]] = defaultdict(list)
    for sample in samples:
        if sample.values.keys() >= {one.key for one in group}:
            time = sample.time.timestamp() / DAY_S
            by_day[int(time)].append([(time, 0.0), *(sample.values[one.key] for one in group)])
    if not by_day:
        return ()
    seen = [np.array(by_day[day]) for day in sorted(by_day)]
    values = np.array([day[..., 0].mean(axis=0) for day in seen])
    sds = np.array([np.sqrt((day[:, 1:, 1] ** 2).mean()) for day in seen])
    days, values = values[:, 0], values[:, 1:]
    lines: Sequence[Line | None] = [None] * len(group)
    if len(days) >= LEAST_DAYS:
        lines = drifts(days, values, sds)
    return tuple(
        Course(*part)
        for part in zip(group, repeat(days), values.T, repeat(sds), lines, strict=False)
    )
