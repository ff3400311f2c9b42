#!/bin/sh
# Tests the oldest versions of the libraries that pyproject.toml allows, in an environment of its own, .venv-oldest:
# the core and the commands while Qt and VTK are not installed (thin: nor what draws reports), then the windows and what reads their files.
#
#     sh packaging/oldest.sh         all of the core, and a choice of the windows
#     sh packaging/oldest.sh thin    from a saved calibration to a measured size by the commands, and files of every library;
#                                    no windows
#
# Needs what "sh packaging/setup.sh test" installs from the system. PYTHON=/path/to/python chooses another Python;
# the oldest versions are older than Python 3.14.
set -eu
cd "$(dirname "$0")/.."

how=${1:-whole}
# These also spoil, and write, what only the windows have.
needs_windows="tests/strangers/test_any_spoilt_file.py tests/strangers/test_clock_set_back.py
    tests/strangers/test_forgeries.py tests/strangers/test_two_programs.py"
core="tests/cli/test_without_window_libraries.py::test_images_become_depth_maps_and_sizes
    tests/session/test_session.py tests/output/test_heightmap_files.py tests/output/test_surface_files.py"
# With what was left out at first, without the windows.
after="tests/test_house.py::test_the_core_works_in_a_notebook_without_the_desktop_program tests/output/test_board_page.py"
processes=1 # beside the tests with the locked libraries
left_out='pyside6-essentials|shiboken6|pyqtgraph|vtk|pytest-qt'
added='matplotlib|typst' # what draws reports
case $how in
thin) left_out="$left_out|$added" ;;
whole)
    processes=2
    # A package is built from the locked versions, never from these, and the golden outputs are those of the locked ones.
    core="tests --ignore tests/app --ignore tests/packaging --ignore tests/golden"
    for file in $needs_windows; do core="$core --ignore $file"; done
    added=$left_out
    after="$needs_windows tests/app/window/test_desktop.py tests/app/program/test_settings.py
        tests/app/calibrate/test_wizard.py tests/app/inspect/test_inspect_page.py tests/output/test_heightmap_files.py"
    ;;
*)
    echo "packaging/oldest.sh: unknown argument \"$how\"; use thin, or nothing." >&2
    exit 2
    ;;
esac

python=${PYTHON:-.venv/bin/python}
if ! "$python" -c 'import sys; sys.exit(sys.version_info >= (3, 14))'; then
    echo "The oldest versions have no files for Python 3.14; choose an older one with PYTHON=/path/to/python." >&2
    exit 0
fi

venv=.venv-oldest
lock=packaging/requirements-oldest.lock

install() { # as standard input, lines of the lock
    "$venv/bin/python" -m pip --disable-pip-version-check --no-input install --quiet --no-deps --require-hashes \
        --only-binary :all: --requirement /dev/stdin
}

entries() { # PROGRAM: the lock's entries whose first line it chooses, with their hashes
    awk "/^[^ #]/ { wanted = $1 } wanted" "$lock"
}

run_tests() { # PYTEST-ARGUMENT...
    # Functions that another numba has compiled are of no use to this one, nor the other way round.
    env OPENBLAS_NUM_THREADS=1 NUMBA_CACHE_DIR="$PWD/$venv/compiled" "$venv/bin/python" -m pytest \
        -p no:cacheprovider --numprocesses $processes --dist loadfile "$@"
}

make_environment() {
    echo "Making $venv with the oldest libraries, without $left_out."
    rm -rf "$venv"
    "$python" -m venv "$venv"
    entries "\$0 !~ /^($left_out)==/" | install
    "$venv/bin/python" -m pip --disable-pip-version-check --no-input install --quiet --no-deps --no-build-isolation \
        --no-index --editable .
}

make_environment
# shellcheck disable=SC2086 # no path of a test holds a space
run_tests --no-xvfb $core

echo "Adding $added."
entries "\$0 ~ /^($added)==/" | install
# shellcheck disable=SC2086
run_tests $after
