#!/bin/sh
# Makes the wheel in dist/, installs it with the locked libraries into an environment of its own, and tries it there.
# Needs what packaging/setup.sh needs; PYTHON=/path/to/python chooses another Python.
set -eu
cd "$(dirname "$0")/.."

work=build/wheel
rm -rf "$work"
mkdir -p "$work" dist
"${PYTHON:-python3}" -m venv "$work/venv"
python=$(pwd)/$work/venv/bin/python

pip() {
    "$python" -m pip --disable-pip-version-check --no-input "$@"
}

# The backend comes with the locked libraries.
pip install --quiet --require-hashes --only-binary :all: --requirement packaging/requirements.lock
PYTHON=$python sh packaging/docs.sh
# From a copy: a build leaves its traces in the folder that it is made from.
{ git ls-files -z && find resources/site -type f -print0; } | xargs -0 tar -cf - |
    tar -xf - -C "$work" --one-top-level=source
pip wheel --quiet --no-deps --no-build-isolation --no-index --wheel-dir "$work" "$work/source"
wheel=$(ls "$work"/*.whl)
pip install --quiet --no-deps --no-index "$wheel"
cd "$work"
venv/bin/gelpolight --version
"$python" - <<'END_OF_CHECK'
from pathlib import Path

import app
from app.window import main_window
from app.window.documentation import find_page
from app.widgets import icons

assert "site-packages" in app.__file__, app.__file__
assert (icons.FOLDER / "gelpolight.svg").is_file()
assert len(list(main_window.BOARDS.glob("*.pdf"))) == 2
assert "site-packages" in str(find_page("guide/calibrate"))
print("Its resources and its guide are there.")
END_OF_CHECK
cd ../..
cp "$wheel" dist/
echo "Wheel: dist/$(basename "$wheel") ($(du -k "$wheel" | cut -f 1) kB)."
