"""Every command that the documentation shows is one that the program takes."""

import re
import shlex
from collections.abc import Iterator

import pytest
from chapter import DOCS

from app.cli.main import build_parser


def commands() -> Iterator[tuple[str, str]]:
    """Return each command line of the chapters and the README, with the chapter's name."""
    for path in (DOCS.parent / "README.md", *sorted(DOCS.rglob("*.md"))):
        for line in path.read_text("utf-8").splitlines():
            # Alone on its line: in a code block, indented or fenced.
            found = re.match(r"(?:    |\$ )?(?:\.venv/bin/)?gelpolight( .+)$", line)
            if found is not None:
                yield path.name, found[1].strip()


@pytest.mark.parametrize(("chapter", "command"), list(commands()))
def test_a_command_of_the_documentation_is_understood(chapter, command, capsys):
    """Options are renamed; what people copy has to follow."""
    arguments = shlex.split(command, comments=True)
    try:
        build_parser().parse_args(arguments)
    except SystemExit as end:
        pytest.fail(f"{chapter}: gelpolight {command}\n{end.code} {capsys.readouterr().err}")
