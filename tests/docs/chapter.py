"""What the tests of the documentation share: chapters, their code blocks and their tables."""

import re
from dataclasses import dataclass
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    """A code block of a chapter: its language, its text, and the line where it begins."""

    language: str
    text: str
    line: int


def blocks(chapter: str, language: str) -> list[Block]:
    """Return the code blocks of a chapter in one language, in their order."""
    text = (DOCS / chapter).read_text("utf-8")
    return [
        Block(found[1], found[2], text.count("\n", 0, found.start()) + 2)
        for found in _BLOCK.finditer(text)
        if found[1] == language
    ]
