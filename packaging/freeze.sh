#!/bin/sh
# Makes the frozen program and its Debian package, by the locked libraries and nothing else.
#
#     sh packaging/freeze.sh           dist/gelpolight-studio/ and dist/gelpolight-studio_VERSION_ARCHITECTURE.deb
#     sh packaging/freeze.sh folder    the folder alone
#     sh packaging/freeze.sh package   the package alone, of the folder that is there
#
# Needs Python 3.11 to 3.14 with venv and its shared library, binutils, and for the package dpkg-deb. The package
# runs on systems at least as new as this one: make it on the oldest that is to be served (Debian 12).
# PYTHON=/path/to/python chooses another Python.
set -eu
cd "$(dirname "$0")/.."

kind=${1:-all}
case $kind in
all | folder | package) ;;
*)
    echo "packaging/freeze.sh: unknown argument \"$kind\"; use folder, package, or nothing." >&2
    exit 2
    ;;
esac

name=gelpolight-studio
work=build/freeze
venv=$work/venv
folder=dist/$name
lock=packaging/requirements-freeze.lock

make_environment() {
    wanted=$(sha256sum "$lock" | cut -d ' ' -f 1)
    [ "$(cat "$venv/made-of" 2>/dev/null)" != "$wanted" ] || return 0
    echo "Freeze: making $venv from $lock."
    rm -rf "$venv"
    "${PYTHON:-python3}" -m venv "$venv"
    "$venv/bin/python" -m pip --disable-pip-version-check --no-input install --quiet \
        --require-hashes --only-binary :all: --requirement "$lock"
    echo "$wanted" >"$venv/made-of"
}

freeze() {
    echo "Freeze: building $folder (some minutes; the log is $work/build.log)."
    "$venv/bin/python" -m PyInstaller --noconfirm --distpath dist --workpath "$work" packaging/gelpolight.spec \
        >"$work/build.log" 2>&1 || {
        tail -n 20 "$work/build.log" >&2
        exit 1
    }
}

size_mb() { # PATH...
    du -cm "$@" | tail -n 1 | cut -f 1
}

report_sizes() {
    echo "Freeze: $folder has $(size_mb "$folder") MB; its largest parts in MB:"
    du -m -d 1 "$folder/_internal" | sort -rn | sed -n '2,13s|dist/.*/||p'
}

# The newest version of the C library that any file asks for.
libc_needed() {
    find "$1" -type f \( -name '*.so*' -o -name gelpolight \) -exec objdump -T {} + 2>/dev/null |
        grep -o 'GLIBC_2\.[0-9]*' | sort -t . -k 2 -n | tail -n 1 | cut -d _ -f 2
}

# One list of what windows need serves the checkout and the package.
window_packages() {
    sed -n '/^window_libraries="/,/^"/s/^lib[^ ]*  *//p' packaging/setup.sh | sort -u
}

make_package() {
    version=$(sed -n 's/^__version__ = "\(.*\)"/\1/p' gelpolight_core/base/version.py)
    architecture=$(dpkg --print-architecture)
    root=$work/deb
    package=dist/${name}_${version}_$architecture.deb
    echo "Freeze: packing $package."
    rm -rf "$root"
    share=$root/usr/share
    mkdir -p "$root/DEBIAN" "$root/usr/bin" "$root/usr/lib" "$share/applications" "$share/mime/packages" \
        "$share/icons/hicolor/scalable/apps" "$share/doc/$name"
    cp -al "$folder" "$root/usr/lib/$name" 2>/dev/null || cp -a "$folder" "$root/usr/lib/$name"
    ln -s "../lib/$name/gelpolight" "$root/usr/bin/gelpolight"
    cp packaging/deb/gelpolight.desktop "$share/applications/"
    cp packaging/deb/gelpolight.xml "$share/mime/packages/"
    cp resources/icons/gelpolight.svg "$share/icons/hicolor/scalable/apps/"
    ln -s "../../../lib/$name/_internal/LICENCES.txt" "$share/doc/$name/copyright"
    ln -s "../../../lib/$name/_internal/resources/site" "$share/doc/$name/html"
    depends="libc6 (>= $(libc_needed "$folder")), libgcc-s1, libstdc++6$(window_packages | sed 's/^/, /' | tr -d '\n')"
    sed -e "s/@VERSION@/$version/" -e "s/@ARCHITECTURE@/$architecture/" -e "s/@DEPENDS@/$depends/" \
        -e "s/@SIZE_KB@/$(du -sk "$root/usr" | cut -f 1)/" packaging/deb/control.in >"$root/DEBIAN/control"
    chmod -R u=rwX,go=rX "$root"
    # xz takes more than a quarter of an hour; Debian 12 and what came after it read this.
    dpkg-deb --root-owner-group -Zzstd -z12 --build "$root" "$package" >/dev/null
    echo "Freeze: $package has $(size_mb "$package") MB, installed $(size_mb "$root/usr") MB."
}

mkdir -p "$work"
if [ "$kind" != package ]; then
    sh packaging/docs.sh
    make_environment
    freeze
fi
report_sizes
[ "$kind" = folder ] || make_package
