#!/bin/sh
# Passes every check and test, from a bare machine on: sh packaging/test.sh [PYTEST-OPTION...]
set -eu
cd "$(dirname "$0")/.."
sh packaging/setup.sh test

failed=
check() { # NAME COMMAND...
    name=$1
    shift
    echo
    echo "== $name"
    started=$(date +%s)
    if "$@"; then verdict=passed; else
        verdict=FAILED
        failed="$failed, $name"
    fi
    echo "== $name $verdict in $(($(date +%s) - started)) s"
}

check "code style" .venv/bin/python -m ruff check .
check "formatting" .venv/bin/python -m ruff format --check .
check "types of the core" .venv/bin/python -m mypy --strict
check "import contracts" .venv/bin/lint-imports
# Two processes share the cores, so that neither needs threads of its own for small matrices.
# Files stay whole, so that what their tests share is made once.
check "tests" env OPENBLAS_NUM_THREADS=1 .venv/bin/python -m pytest --numprocesses 2 --dist loadfile "$@"
# Not where only some tests are asked for.
[ $# -gt 0 ] || check "oldest libraries, and the core without Qt" sh packaging/oldest.sh thin

echo
if [ -n "$failed" ]; then
    echo "Failed: ${failed#, }" >&2
    exit 1
fi
echo "All checks and tests passed."
