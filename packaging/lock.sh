#!/bin/sh
# Makes the lock files again from pyproject.toml: all with the newest versions that it allows, but
# requirements-oldest with the oldest (packaging/oldest.sh tests with these).
#
#     sh packaging/lock.sh         every version anew
#     sh packaging/lock.sh keep    versions that are locked stay; only what is missing or no longer allowed changes
#
# Needs Python 3.11 to 3.14 with venv, and the network. The tool that resolves (uv) lives in a folder that is deleted.
set -eu
cd "$(dirname "$0")/.."

case ${1:-anew} in
anew | keep) ;;
*)
    echo "packaging/lock.sh: unknown argument \"$1\"; use keep, or nothing." >&2
    exit 2
    ;;
esac
how=${1:-anew}

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
    # uv prefers the versions that it finds in the file it is to write.
    rm -f "$scratch/lock.txt"
    [ "$how" != keep ] || [ ! -f "$file" ] || cp "$file" "$scratch/lock.txt"
    # One set of versions on every supported Python, so that a fault seen on one machine is seen on all.
    # shellcheck disable=SC2086 # the basis is a list of files
    "$scratch/venv/bin/uv" pip compile --quiet --no-config --universal --python-version 3.11 \
        --fork-strategy fewest --generate-hashes --no-annotate --no-header \
        "$@" $basis --output-file "$scratch/lock.txt" >/dev/null
    {
        echo "# $what, exact versions by hash, for Python 3.11 to 3.14. Made by packaging/lock.sh; do not edit."
        cat "$scratch/lock.txt"
    } >"$file"
    echo "Written: $file"
}

lock packaging/requirements.lock "What the program needs" --extra gui
lock packaging/requirements-dev.lock "What the program and its tests need" --extra gui --extra dev \
    --constraint packaging/requirements.lock

# The tools that run the tests are not what is tested with the oldest versions: they stay as they are locked.
grep -E '^(pytest|hypothesis)' packaging/requirements-dev.lock | sed 's/ .*//' >"$scratch/tools.txt"
lock packaging/requirements-oldest.lock "The oldest versions that the program allows, and what tests it" --extra gui --extra dask \
    --resolution lowest-direct "$scratch/tools.txt"

# PyInstaller is GPL 2 with an exception for what it builds: a tool of the build, never a part of the program.
echo "pyinstaller>=6.16" >"$scratch/freeze.txt"
lock packaging/requirements-freeze.lock "What the frozen build is made of and with" --extra gui "$scratch/freeze.txt" \
    --constraint packaging/requirements.lock

# What builds the documentation shares nothing with the program.
"$scratch/venv/bin/python" - >"$scratch/docs.txt" <<'END'
import tomllib
from pathlib import Path

print(*tomllib.loads(Path("pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]["docs"], sep="\n")
END
basis=$scratch/docs.txt
lock packaging/requirements-docs.lock "What builds the documentation"
