#!/bin/sh
# Makes .venv in the checkout: the locked libraries by their hashes, then the project itself, editable.
#
#     sh packaging/setup.sh run         what the program needs
#     sh packaging/setup.sh commands    the same without the system libraries of a window, for machines without a screen
#     sh packaging/setup.sh test        what the program, the checks and the tests need
#
# Except for tests, what the first start would otherwise compile is compiled here (about a minute). For the window the
# pages that Help opens are made meanwhile.
# Safe to run again; quick when nothing has changed. PYTHON=/path/to/python chooses another Python.
# What the system lacks is installed with apt-get, as root or by sudo, in one step and only when it is missing.
set -eu
cd "$(dirname "$0")/.."

kind=${1:-run}
case $kind in
run | commands) lock=packaging/requirements.lock ;;
test) lock=packaging/requirements-dev.lock ;;
*)
    echo "packaging/setup.sh: unknown argument \"$kind\"; use run, commands or test." >&2
    exit 2
    ;;
esac

venv=.venv
libraries_stamp=$venv/gelpolight-libraries # "run HASH" or "test HASH": written when all of them are in
project_stamp=$venv/gelpolight-project
trusted_authorities=/etc/ssl/certs/ca-certificates.crt
step="looking at this machine"

# What Qt's window needs from the system: the library that is looked for, and the Debian package that has it.
window_libraries="
libEGL.so.1             libegl1
libGL.so.1              libgl1
libOpenGL.so.0          libopengl0
libdbus-1.so.3          libdbus-1-3
libfontconfig.so.1      libfontconfig1
libglib-2.0.so.0        libglib2.0-0
libX11-xcb.so.1         libx11-xcb1
libxcb-cursor.so.0      libxcb-cursor0
libxcb-icccm.so.4       libxcb-icccm4
libxcb-image.so.0       libxcb-image0
libxcb-keysyms.so.1     libxcb-keysyms1
libxcb-randr.so.0       libxcb-randr0
libxcb-render-util.so.0 libxcb-render-util0
libxcb-shape.so.0       libxcb-shape0
libxcb-sync.so.1        libxcb-sync1
libxcb-xfixes.so.0      libxcb-xfixes0
libxcb-xinerama.so.0    libxcb-xinerama0
libxcb-xkb.so.1         libxcb-xkb1
libxkbcommon-x11.so.0   libxkbcommon-x11-0
"

explain_failure() {
    [ "$1" -eq 0 ] || echo "The set-up failed while $step: see above. It can be run again as it is." >&2
}
trap 'explain_failure $?' EXIT

stop() {
    echo "$1" >&2
    trap - EXIT
    exit 2
}

begin() { # STEP [NOTE]
    step=$1
    echo "Set-up: $1${2:+ ($2)}."
}

# Python 3.11 to 3.14, 64 bit: what the locked libraries are built for.
fits() { # PYTHON
    "$1" -c 'import sys; sys.exit(not ((3, 11) <= sys.version_info[:2] < (3, 15) and sys.maxsize > 2**32))' \
        >/dev/null 2>&1
}

makes_environments() { # PYTHON
    "$1" -c 'import ensurepip, venv' >/dev/null 2>&1
}

# The first fitting Python that can make an environment; else the first that fits; else none.
choose_python() {
    python=
    if [ -n "${PYTHON:-}" ]; then set -- "$PYTHON"; else set -- python3 python3.11 python3.12 python3.13 python3.14; fi
    for candidate in "$@"; do
        fits "$candidate" || continue
        if makes_environments "$candidate"; then
            python=$candidate
            return
        fi
        python=${python:-$candidate}
    done
}

install_packages() { # PACKAGE...
    command -v apt-get >/dev/null 2>&1 ||
        stop "This machine lacks what Debian packages as: $*. There is no apt-get here; install them and run this again."
    if [ "$(id -u)" -eq 0 ]; then
        as_root=
    elif command -v sudo >/dev/null 2>&1; then
        as_root=sudo
    else
        stop "System packages are missing. Ask an administrator for \"apt-get install $*\" and run this again."
    fi
    begin "installing the system packages $*"
    $as_root apt-get update -qq
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

# By the libraries, not by the names of packages, which differ between systems.
missing_for_a_window() {
    present=$(PATH=$PATH:/sbin:/usr/sbin ldconfig -p 2>/dev/null) || return 0
    echo "$window_libraries" | while read -r library package; do
        [ -n "$library" ] || continue
        case $present in
        *"$library "*) ;;
        *) echo "$package" ;;
        esac
    done
}

# What a new environment needs, one package a line. Without the certificates no download can be verified;
# systems that keep them elsewhere have no apt-get.
missing_for_an_environment() {
    if [ -z "$python" ]; then
        [ -n "${PYTHON:-}" ] || printf '%s\n' python3 python3-venv
    elif ! makes_environments "$python"; then
        "$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])'
    fi
    if command -v apt-get >/dev/null 2>&1 && [ ! -s "$trusted_authorities" ]; then echo ca-certificates; fi
}

missing_for_tests() {
    command -v Xvfb >/dev/null 2>&1 || echo xvfb
    command -v pdftotext >/dev/null 2>&1 || echo poppler-utils
}

# All at once, so that a person without administrator rights is stopped once only.
install_what_the_system_lacks() {
    # shellcheck disable=SC2046 # names of packages hold no spaces
    set -- $([ -z "$new" ] || missing_for_an_environment
        [ "$kind" = commands ] || missing_for_a_window
        [ "$kind" != test ] || missing_for_tests)
    [ $# -eq 0 ] || install_packages "$@"
}

make_environment() {
    choose_python
    [ -n "$python" ] || stop "No 64-bit Python 3.11 to 3.14 was found${PYTHON:+ as $PYTHON}; install one\
 (on Debian 12: apt-get install python3 python3-venv), or name it with PYTHON=/path/to/python, and run this again."
    makes_environments "$python" ||
        stop "$python cannot make environments (venv and ensurepip are missing); install them, or name another Python\
 with PYTHON=/path/to/python, and run this again."
    if [ -e "$venv" ]; then
        begin "removing the unfinished or outdated $venv"
        rm -rf "$venv"
    fi
    begin "making $venv with $("$python" --version 2>&1)"
    "$python" -m venv "$venv"
}

pip() {
    "$venv/bin/python" -m pip --disable-pip-version-check --no-input "$@"
}

hash_of() { # FILE...: together with where the environment stands, which it cannot survive being moved from
    { pwd -P && cat "$@"; } | sha256sum | cut -d ' ' -f 1
}

wanted=run # the same libraries for the commands, as far as .venv is concerned
[ "$kind" != test ] || wanted=test

# One set of versions in both locks, so that the test environment also serves the program.
libraries=$(hash_of packaging/requirements.lock packaging/requirements-dev.lock)
project=$(hash_of pyproject.toml)
found=
if fits "$venv/bin/python" && [ -f "$libraries_stamp" ]; then
    found=$(cat "$libraries_stamp")
fi
if [ -n "${PYTHON:-}" ] && [ -n "$found" ]; then
    version='import sys; print(sys.version_info[:2])'
    [ "$("$venv/bin/python" -c "$version")" = "$("$PYTHON" -c "$version")" ] || found=
fi

# Adding the tests' libraries to a whole environment is safe; everything else starts afresh.
new=yes
case $found in "run $libraries" | "test $libraries") new= ;; esac
choose_python
install_what_the_system_lacks

# The pages that Help opens, beside the rest.
docs=
if [ "$kind" = run ]; then
    PYTHON=$python sh packaging/docs.sh >/dev/null &
    docs=$!
fi

if [ "$found" != "$wanted $libraries" ] && [ "$found" != "test $libraries" ]; then
    [ -z "$new" ] || make_environment
    rm -f "$libraries_stamp"
    begin "installing the libraries of $lock" "the first time, about a minute"
    # Tests import a part of the libraries, and compile it then.
    compiled=--compile
    [ "$wanted" = run ] || compiled=--no-compile
    pip install --quiet $compiled --require-hashes --only-binary :all: --requirement "$lock"
    echo "$wanted $libraries" >"$libraries_stamp"
fi

if [ "$(cat "$project_stamp" 2>/dev/null)" != "$project" ] || [ ! -x "$venv/bin/gelpolight" ]; then
    begin "installing the project into $venv"
    pip install --quiet --no-deps --no-build-isolation --no-index --editable .
    echo "$project" >"$project_stamp"
fi
# Tests compile while their types are checked.
if [ "$kind" != test ] && ! "$venv/bin/python" -m app.cli.warm_up; then
    echo "Set-up: this step failed, see above. The program works, but its first start will take longer." >&2
fi
if [ -n "$docs" ] && ! wait "$docs"; then
    echo "Set-up: the documentation was not made, see above. The program works without it." >&2
fi
step="finishing"
echo "Set-up: $venv is ready."
