"""Fuzz every reader of files from elsewhere: ``fuzz.py FOLDER COUNT``.

Each input is a good small file, spoilt; it is read with limited memory and time. A good result or a
refusal (InputError) is right; anything else is a finding. The input that is being read is named in
FOLDER, for one that ends the process.
"""

import logging
import os
import random
import resource
import shutil
import signal
import sys
import traceback
import warnings
from pathlib import Path

import cv2
from fuzz_kinds import Kind, all_kinds

from gelpolight_core.base.errors import InputError

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
    cv2.setNumThreads(1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    own = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (own + MEMORY_BYTES,) * 2)


def main(folder: Path, count: int) -> None:
    """Read spoilt inputs of every kind; exit with 1 at the first that is no good and no refusal."""
    kinds = all_kinds(folder)
    limit()
    for kind in kinds:
        for number in range(count):
            data = spoilt_input(kind, 0, number)
            (folder / "input").write_text(f"{kind.name} {number}")
            signal.setitimer(signal.ITIMER_PROF, TIME_S)  # of the processor: it ends the process
            result = try_one(kind, data, folder / "in")
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            if result not in ("good", "refused"):
                print(result)
                sys.exit(1)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
