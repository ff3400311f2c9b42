#!/bin/sh
# Builds the documentation of docs/ into resources/site/, which Help opens in the browser without a network.
# Its tools go into .venv-docs, apart from the program's. Safe to run again. PYTHON=/path/to/python chooses another Python.
set -eu
cd "$(dirname "$0")/.."

lock=packaging/requirements-docs.lock
venv=.venv-docs
site=resources/site
stamp=$venv/gelpolight-docs # what is installed, and where: an environment cannot be moved
wanted=$({ pwd -P && cat "$lock"; } | sha256sum)

if [ "$(cat "$stamp" 2>/dev/null)" != "$wanted" ]; then
    echo "Documentation: installing what builds it into $venv."
    rm -rf "$venv"
    "${PYTHON:-python3}" -m venv "$venv"
    "$venv/bin/python" -m pip --disable-pip-version-check --no-input install --quiet --require-hashes \
        --only-binary :all: --requirement "$lock"
    echo "$wanted" >"$stamp"
fi

"$venv/bin/python" -m properdocs build --strict --quiet --clean --site-dir "$site"

# Whoever hands the site on hands on the theme's scripts and styles.
cp "$venv"/lib/python*/site-packages/properdocs_theme_mkdocs-*.dist-info/licenses/LICENSE "$site/LICENSE-theme.txt"

if grep -rnE '(src="|<link [^>]*href=")https?:' --include='*.html' "$site"; then
    echo "These pages would fetch something from the network when they are read; keep it in docs/ instead." >&2
    exit 1
fi
echo "Documentation: open $(pwd)/$site/index.html"
