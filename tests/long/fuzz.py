"""Fuzz every reader of files from elsewhere: ``python tests/long/fuzz.py [--count N] [--seed S]``.

Each input is a good small file, spoilt; it is read with limited memory and time. A good result or a
refusal (InputError) is right; anything else is a finding: its bytes are kept in the folder of
findings, and the exit status is 1. An input that ends the process is the last one there: go on
after it with --first and --kind. One seed gives the same inputs.
"""

from __future__ import annotations

import argparse
import logging
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path

import cv2
from fuzz_kinds import Kind, all_kinds

from gelpolight_core.errors import InputError

# Beyond what the program itself takes: one image of 64 megapixels and its copy as floats.
MEMORY_BYTES = 1_500_000_000
TIME_S = 10.0
SENTENCE = 2000


def spoilt_input(kind: Kind, seed: int, number: int) -> bytes:
    """Return an input; the same for the same kind, seed and number."""
    rng = random.Random(f"{kind.name} {seed} {number}")
    data = rng.choice(kind.seeds)
    for _ in range(rng.choice((1, 1, 1, 2))):
        try:
            data = rng.choice(kind.spoilt)(rng, data)
        except Exception:  # a forger needs a file that is whole; this one is spoilt already
            break
    return data


def try_one(kind: Kind, data: bytes, folder: Path) -> str:
    """Return how reading went: "good", "refused", or what was raised in place of a refusal."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    path = folder / kind.file
    path.write_bytes(data)
    try:
        kind.use(path)
    except InputError as error:
        output = str(error).replace(str(folder), "")
        return (
            "refused"
            if len(output) < SENTENCE and output.isprintable()
            else f"says {output[:200]!r}"
        )
    except BaseException:
        return traceback.format_exc(limit=-6)
    return "good"


def limit() -> None:
    """Limit the memory of this process, and keep the image libraries' messages out of sight."""
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    own = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (own + MEMORY_BYTES,) * 2)


def fuzz(kind: Kind, options: argparse.Namespace, folder: Path) -> int:
    """Try inputs of one kind; return how many were neither read nor refused."""
    results: Counter[str] = Counter()
    longest_s = 0.0
    for number in range(options.first, options.first + options.count):
        data = spoilt_input(kind, options.seed, number)
        stem = options.findings / f"{kind.name.replace(' ', '-')}-{number}"
        stem.write_bytes(data)  # it stays where reading it ends this process
        signal.setitimer(signal.ITIMER_PROF, TIME_S)  # of the processor: it ends the process
        begun = time.process_time()
        result = try_one(kind, data, folder)
        longest_s = max(longest_s, time.process_time() - begun)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        if result in ("good", "refused"):
            stem.unlink()
        else:
            stem.with_suffix(".txt").write_text(result, encoding="utf-8")
            result = "findings"
        results[result] += 1
    print(kind.name, dict(results), f"longest {longest_s:.2f} s", flush=True)
    return results["findings"]


def main() -> int:
    """Fuzz all kinds, or those named; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=6000, help="inputs of each kind")
    parser.add_argument("--first", type=int, default=0, help="number of the first input")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", action="append", help="only this kind; may be repeated")
    parser.add_argument("--findings", type=Path, default=Path("fuzz-findings"))
    options = parser.parse_args()
    options.findings.mkdir(parents=True, exist_ok=True)
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as place:
        kinds = all_kinds(Path(place))
        limit()
        chosen = [kind for kind in kinds if not options.kind or kind.name in options.kind]
        found = sum([fuzz(kind, options, Path(place) / "in") for kind in chosen])
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
