"""Fuzz every reader of files from elsewhere: ``python tests/long/fuzz.py [--count N] [--seed S]``.

Each input is a good small file, spoilt; it is read in a process of its own kind whose memory and
time are limited. A good result or a refusal (InputError) is right; anything else is a finding: its
bytes are kept in the folder of findings, and the exit status is 1. One seed gives the same inputs.
"""

from __future__ import annotations

import argparse
import logging
import multiprocessing
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
from multiprocessing.connection import Connection
from pathlib import Path

import cv2
from fuzz_kinds import Kind, all_kinds

from gelpolight_core.errors import InputError

BLOCK = 500
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


def _work(kind: Kind, seed: int, first: int, last: int, folder: Path, out: Connection) -> None:
    """Try inputs one by one; what is begun and how it ended goes to the parent at once."""
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)  # the image libraries tell of every damage there
    with open("/proc/self/statm", encoding="ascii") as stream:
        own = int(stream.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (own + MEMORY_BYTES,) * 2)
    for number in range(first, last):
        data = spoilt_input(kind, seed, number)
        out.send((number, None, 0.0))
        signal.setitimer(signal.ITIMER_PROF, TIME_S)  # of the processor: it ends the process
        begun = time.process_time()
        result = try_one(kind, data, folder)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        out.send((number, result, time.process_time() - begun))


def fuzz(kind: Kind, count: int, seed: int, folder: Path, findings: Path) -> Counter[str]:
    """Try `count` inputs of one kind; return how many went how."""
    results: Counter[str] = Counter()
    number, begun_s, slowest_s = 0, time.process_time(), 0.0
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    while number < count:
        last = min(number + BLOCK, count)
        ours, theirs = multiprocessing.Pipe(duplex=False)
        process = multiprocessing.Process(
            target=_work, args=(kind, seed, number, last, folder, theirs)
        )
        process.start()
        theirs.close()
        while number < last:
            try:
                if not ours.poll(20 * TIME_S):
                    process.kill()
                    result, taken_s = "it waits for ever", 0.0
                else:
                    number, result, taken_s = ours.recv()
            except EOFError:
                process.join()
                result, taken_s = f"it ended the process: {process.exitcode}", 0.0
            if result is None:
                continue
            slowest_s = max(slowest_s, taken_s)
            if result not in ("good", "refused"):
                _keep(kind, number, spoilt_input(kind, seed, number), result, findings)
                result_name = "FINDING"
            else:
                result_name = result
            results[result_name] += 1
            number += 1
            if not process.is_alive() and result.startswith("it "):
                break
        process.join()
        ours.close()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    spent_s += time.process_time() - begun_s
    print(
        f"{kind.name:14} {count:7} inputs {results['good']:7} good {results['refused']:7} refused"
        f" {results['FINDING']:5} findings {spent_s:7.1f} s  slowest {1e3 * slowest_s:6.0f} ms",
        flush=True,
    )
    return results


def _keep(kind: Kind, number: int, data: bytes, result: str, findings: Path) -> None:
    findings.mkdir(parents=True, exist_ok=True)
    stem = f"{kind.name.replace(' ', '-')}-{number}"
    (findings / stem).write_bytes(data)
    (findings / f"{stem}.txt").write_text(result, encoding="utf-8")


def main() -> int:
    """Fuzz all kinds, or those named; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=6000, help="inputs of each kind")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", action="append", help="only this kind; may be repeated")
    parser.add_argument("--findings", type=Path, default=Path("fuzz-findings"))
    options = parser.parse_args()
    multiprocessing.set_start_method("fork")
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as place:
        kinds = all_kinds(Path(place))
        total: Counter[str] = Counter()
        begun_s = time.monotonic()
        for kind in kinds:
            if not options.kind or kind.name in options.kind:
                total += fuzz(
                    kind, options.count, options.seed, Path(place) / "in", options.findings
                )
    print(
        f"{total.total()} inputs in {time.monotonic() - begun_s:.0f} s by the clock:"
        f" {total['good']} good, {total['refused']} refused, {total['FINDING']} findings"
    )
    return 1 if total["FINDING"] else 0


if __name__ == "__main__":
    sys.exit(main())
