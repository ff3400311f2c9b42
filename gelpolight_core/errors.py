"""The error that a user can fix."""

from __future__ import annotations

from functools import partial

from gelpolight_core.translation import pattern


class InputError(Exception):
    """Input that the user can correct. It is shown as one sentence, never as a traceback.

    Parameters
    ----------
    found : str
        What is wrong, as a sentence without a full stop ("The image is black").
    where : str
        The file, stage or key where it was found.
    advice : str
        What to do about it, as a sentence without a full stop ("Open the shutter").

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> try:
    ...     gp.read_calibration("missing.gplcal")
    ... except gp.InputError as error:
    ...     print(error.where)
    missing.gplcal
    """

    def __init__(self, found: str, *, where: str, advice: str) -> None:
        self.found = found
        self.where = where
        self.advice = advice
        super().__init__(found, where, advice)

    def __reduce__(self) -> tuple[partial[InputError], tuple[str]]:
        """Return what a copy in another process is made from."""
        return partial(type(self), where=self.where, advice=self.advice), (self.found,)

    @property
    def text(self) -> str:
        """Where, what and advice, also in English."""
        where, found, advice = map(_printable, (self.where, self.found, self.advice))
        return pattern("{where}: {found}. {advice}.", where=where, found=found, advice=advice)

    def __str__(self) -> str:
        """Return the message that the user reads: where, what, advice."""
        return str(self.text)


def _printable(text: str) -> str:
    """Return a text without terminal control characters, which a file name may contain."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
