"""What the set-up prepares: ``python -m app.prepare``."""

from __future__ import annotations

import sys

from app.warm_up import compile_loops


def main() -> int:
    """Prepare what the first start would otherwise wait for; quick when nothing has changed."""

    def show(what: str, number: int, count: int) -> None:
        print(f"Set-up: compiling {number} of {count}: {what}.", flush=True)

    compile_loops(show)
    return 0


if __name__ == "__main__":
    sys.exit(main())
