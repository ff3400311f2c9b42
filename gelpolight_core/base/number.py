"""Numbers as people write them: in fields, tables and options."""

from __future__ import annotations

import math
import re
from pathlib import Path

from .errors import InputError, Remedy
from .safe_reading import short_repr

_NUMBER = re.compile(r"[+-]?(?=[.,]?\d)(0|[1-9]\d*)?([.,]\d*)?(e[+-]?\d+)?", re.A | re.I)
_GROUPED = re.compile(
    r"([+-]?[1-9]\d{0,2}([.,' \xa0\u202f])\d{3}(?:\2\d{3})*)((?!\2)[.,]\d+)?", re.A
)


def read_number(text: str, where: str | Path, *, decimals: int | None = None) -> float:
    """Return the number of a text.

    One point or one comma is the decimal sign, whatever the system: ``5,002`` is 5.002, as on a
    German numeric pad and on a certificate. A sign between thousands is never read. So every text
    is the number that its only sign makes, or is refused with the readings that it could have:
    ``1.234,5``, ``1,234,567``, and ``1,234`` where three decimals are not possible.

    Parameters
    ----------
    text : str
        The text; blanks around it do not count.
    where : str or Path
        Its place, for the message.
    decimals : int, optional
        How many it can have. Default: any number.

    Raises
    ------
    InputError
        If it is not exactly one finite number with so many decimals.
    """
    text = text.strip()
    grouped = _GROUPED.fullmatch(text)
    readings = []
    if _NUMBER.fullmatch(text) and math.isfinite(value := float(text.replace(",", "."))):
        fits = decimals is None or round(value, decimals) == value
        if fits and (decimals is None or decimals >= 3 or not grouped):
            return value
        readings = [text.replace(",", ".")]
    message, advice = "'{text}' is not a number", Remedy.CORRECT_VALUE
    if grouped:
        whole, sign, decimal_part = grouped.groups("")
        readings.append(whole.replace(sign, "") + decimal_part.replace(",", "."))
        message, advice = "{text} could be {readings}", Remedy.WRITE_POINT
    elif readings:
        message = "{text} has more than {n} decimals"
    joined = " or ".join(readings)
    raise InputError(
        message.format(text=short_repr(text), n=decimals, readings=joined), where, advice
    )
