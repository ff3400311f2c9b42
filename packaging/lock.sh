#!/bin/sh
# Makes the lock files again from pyproject.toml, with the newest versions that it allows.
# Needs Python 3.11 to 3.13 with venv, and the network. The tool that resolves (uv) lives in a folder that is thrown away.
set -eu
cd "$(dirname "$0")/.."

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
"${PYTHON:-python3}" -m venv "$scratch/venv"
"$scratch/venv/bin/python" -m pip install --quiet --disable-pip-version-check uv

# The build backend is locked as well: the project is installed without build isolation.
"$scratch/venv/bin/python" - >"$scratch/build.txt" <<'END'
import tomllib
from pathlib import Path

print(*tomllib.loads(Path("pyproject.toml").read_text("utf-8"))["build-system"]["requires"], sep="\n")
END
basis="pyproject.toml $scratch/build.txt"

lock() { # FILE WHAT [OPTION...]
    file=$1
    what=$2
    shift 2
    # shellcheck disable=SC2086 # the basis is a list of files
    # One set of versions on every supported Python, so that a fault seen on one machine is seen on all.
    "$scratch/venv/bin/uv" pip compile --quiet --no-config --universal --python-version 3.11 \
        --fork-strategy fewest --generate-hashes --no-annotate --no-header \
        "$@" $basis >"$scratch/lock.txt"
    {
        echo "# $what, exact versions by hash, for Python 3.11 to 3.13. Made by packaging/lock.sh; do not edit."
        cat "$scratch/lock.txt"
    } >"$file"
    echo "Written: $file"
}

lock packaging/requirements.lock "What the program needs"
lock packaging/requirements-dev.lock "What the program and its tests need" --extra dev \
    --constraint packaging/requirements.lock

# What builds the documentation shares nothing with the program.
"$scratch/venv/bin/python" - >"$scratch/docs.txt" <<'END'
import tomllib
from pathlib import Path

print(*tomllib.loads(Path("pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]["docs"], sep="\n")
END
basis=$scratch/docs.txt
lock packaging/requirements-docs.lock "What builds the documentation"
