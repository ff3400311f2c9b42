#!/bin/sh
# The program on the virtual sensor, from a bare machine on.
set -eu
cd "$(dirname "$0")/.."

if [ -z "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; then
    echo "There is no screen here to show the program on: run this on a desktop or over ssh -X, or see the same work\
 without a window with \"sh packaging/tour.sh\"." >&2
    exit 2
fi
sh packaging/setup.sh run
exec .venv/bin/gelpolight --demo
