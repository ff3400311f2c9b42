"""The one error a person can mend."""

from __future__ import annotations


class InputError(Exception):
    """Input that a person can mend; shown as one sentence, never as a traceback.

    Parameters
    ----------
    found : str
        What was found, as a clause without a full stop ("the picture is all black").
    where : str
        The file, stage or key that it was found in.
    advice : str
        What to do about it, as a sentence without a full stop ("Open the shutter").
    """

    def __init__(self, found: str, *, where: str, advice: str) -> None:
        self.found = found
        self.where = where
        self.advice = advice
        super().__init__(found, where, advice)

    def __str__(self) -> str:
        """Return the one sentence that a person reads."""
        said = f"{self.where}: {self.found}. {self.advice}."
        if said.isprintable():
            return said
        # A name from elsewhere may hold what commands a terminal.
        return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in said)
