"""Read what a user and a program find in a report."""

import json
import re
import subprocess
import zlib
from pathlib import Path
from shutil import which
from typing import Any

import pytest


def report_data(path: Path) -> dict[str, Any]:
    """Return the data that are attached to a report, without a PDF library."""
    for stream in re.findall(rb"stream\r?\n(.*?)endstream", path.read_bytes(), re.DOTALL):
        try:
            # The data end by themselves; their last byte can look like the end of a line.
            content = zlib.decompressobj().decompress(stream)
        except zlib.error:
            continue  # not compressed: no attachment
        if b"gelpolight-report" in content[:100]:
            return dict(json.loads(content))
    raise AssertionError(f"{path} has no data attached")


def report_text(path: Path) -> str:
    """Return the text on the pages of a report, its words separated by single spaces."""
    if which("pdftotext") is None:
        pytest.skip("pdftotext is not installed")
    return " ".join(subprocess.check_output(["pdftotext", str(path), "-"], text=True).split())
