"""A process that forks a copy of itself for each job: ``python forking.py MODULE``.

A job is a line of standard input: ``{"out": file, "arguments": [...]}``. The copy runs the module's
``main()`` with these arguments and writes to the file; its process id is printed, and, when it has
ended, the signal that ended it.
"""

from __future__ import annotations

import importlib
import json
import os
import sys


def main() -> None:
    """Fork until standard input ends."""
    module = importlib.import_module(sys.argv[1])
    for line in sys.stdin:
        job = json.loads(line)
        copy = os.fork()
        if copy == 0:
            os.dup2(os.open(job["out"], os.O_WRONLY), sys.stdout.fileno())
            sys.argv[1:] = job["arguments"]
            module.main()
            os._exit(0)
        print(copy, flush=True)
        _, status = os.waitpid(copy, 0)
        print(os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0, flush=True)


if __name__ == "__main__":
    main()
