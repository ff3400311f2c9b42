#!/bin/sh
# Passes every check and test, from a bare machine on.
#
#     sh packaging/test.sh [PYTEST-OPTION...]
#     sh packaging/test.sh --long [PYTEST-OPTION...]    the proofs in tests/long, which take hours;
#                                                       their result is kept in tests/long/last_run.md
set -eu
cd "$(dirname "$0")/.."
sh packaging/setup.sh test

# Two processes share the cores, so that neither needs threads of its own for small matrices.
# Files stay whole, so that what their tests share is made once; tests/conftest.py sets their order.
run_tests() { # PYTEST-OPTION...
    env OPENBLAS_NUM_THREADS=1 .venv/bin/python -m pytest --numprocesses 2 --dist loadfile \
        --no-loadscope-reorder --max-worker-restart 0 "$@"
}

if [ "${1:-}" = --long ]; then
    shift
    run_tests --long -o norecursedirs="" tests tests/long --keep-result tests/long/last_run.md "$@"
    exit
fi

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

# One core for what compiles, once for both processes of the tests, and one for the rest.
check "compiling" env OPENBLAS_NUM_THREADS=1 .venv/bin/python -m app.cli.warm_up >"$results/compiling" 2>&1 &
compiling=$!
check "code style" .venv/bin/python -m ruff check .
check "formatting" .venv/bin/python -m ruff format --check .
check "import contracts" .venv/bin/lint-imports
check "types" .venv/bin/python -m mypy --strict
wait "$compiling"
cat "$results/compiling"

# Beside the tests; not where only some are asked for.
if [ $# -eq 0 ]; then
    check "oldest libraries, and the core without Qt" sh packaging/oldest.sh thin >"$results/oldest" 2>&1 &
    oldest=$!
fi
check "tests" run_tests "$@"
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
