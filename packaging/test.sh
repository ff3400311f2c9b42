#!/bin/sh
# Passes every check and test, from a bare machine on: sh packaging/test.sh [PYTEST-OPTION...]
set -eu
cd "$(dirname "$0")/.."
sh packaging/setup.sh test

results=$(mktemp -d)
trap 'rm -rf "$results"' EXIT

check() { # NAME COMMAND...
    name=$1
    shift
    echo
    echo "== $name"
    started=$(date +%s)
    if "$@"; then verdict=passed; else
        verdict=FAILED
        echo "$name" >>"$results/failed"
    fi
    echo "== $name $verdict in $(($(date +%s) - started)) s"
}

# Beside everything else; not where only some tests are asked for.
if [ $# -eq 0 ]; then
    check "oldest libraries, and the core without Qt" sh packaging/oldest.sh thin >"$results/oldest" 2>&1 &
    oldest=$!
fi

# One core for the types, and one for the rest.
check "types" .venv/bin/python -m mypy --strict >"$results/types" 2>&1 &
types=$!
check "code style" .venv/bin/python -m ruff check .
check "formatting" .venv/bin/python -m ruff format --check .
check "import contracts" .venv/bin/lint-imports
wait "$types"
cat "$results/types"

# Two processes share the cores, so that neither needs threads of its own for small matrices.
# Files stay whole, so that what their tests share is made once; tests/conftest.py sets their order.
check "tests" env OPENBLAS_NUM_THREADS=1 .venv/bin/python -m pytest --numprocesses 2 --dist loadfile \
    --no-loadscope-reorder --max-worker-restart 0 "$@"
if [ $# -eq 0 ]; then
    wait "$oldest"
    cat "$results/oldest"
fi

echo
if [ -e "$results/failed" ]; then
    echo "Failed: $(paste -s -d , "$results/failed")" >&2
    exit 1
fi
echo "All checks and tests passed."
