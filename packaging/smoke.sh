#!/bin/sh
# Proves a Debian package of the program in a bare Debian 12 without Python, as an ordinary user without a graphics card.
#
#     sh packaging/smoke.sh BUILD SESSION [OUT]
#
# BUILD is the package, SESSION a session folder with presses, OUT (build/smoke) where the pictures and figures go.
# Needs root, debootstrap, xwd reading by ImageMagick's convert, and a Debian mirror (debootstrap's own, or MIRROR).
set -eu

[ $# -ge 2 ] && [ -f "$1" ] && [ -f "$2/session.toml" ] || {
    echo "Usage: sh packaging/smoke.sh BUILD.deb SESSION [OUT]: one of these is not there." >&2
    exit 2
}
package=$(realpath "$1")
session=$(realpath "$2")
mkdir -p "${3:-build/smoke}"
out=$(realpath "${3:-build/smoke}")
# All mounts are this process's own: they vanish with it, however it ends.
[ "${SMOKE_ALONE:-}" = yes ] || exec env SMOKE_ALONE=yes unshare --mount sh "$0" "$package" "$session" "$out"

base=$out/debian
place=$out/place
home=/home/technician
program=/usr/lib/gelpolight-studio
screen=:97
figures=$out/figures.txt
: >"$figures"

step() {
    echo "Smoke: $1"
}

say() {
    echo "$1" | tee -a "$figures"
}

fail() {
    echo "Smoke: FAILED: $1" >&2
    exit 1
}

inside() { # COMMAND...: as root
    chroot "$place" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin DEBIAN_FRONTEND=noninteractive LANG=C.UTF-8 "$@"
}

as_user() { # COMMAND...: in the place of this shell, so that its process is the command's
    exec chroot --userspec=technician:technician "$place" env -i PATH=/usr/bin:/bin HOME=$home USER=technician \
        LANG=C.UTF-8 DISPLAY=$screen XDG_RUNTIME_DIR=/tmp/runtime sh -c 'cd && exec "$@"' sh "$@"
}

make_place() {
    if [ ! -f "$base/complete" ]; then
        step "making a bare Debian 12"
        rm -rf "$base"
        debootstrap --variant=minbase bookworm "$base" ${MIRROR:+"$MIRROR"} >"$out/debootstrap.log"
        touch "$base/complete"
    fi
    rm -rf "$place"
    cp -a "$base" "$place"
    cp /etc/resolv.conf "$place/etc/"
    mount -t proc proc "$place/proc"
    mount -t tmpfs tmpfs "$place/dev/shm" 2>/dev/null || { mkdir -p "$place/dev/shm" && mount -t tmpfs tmpfs "$place/dev/shm"; }
    step "installing the package with what it asks for, and a screen"
    cp "$package" "$place/tmp/package.deb"
    {
        inside apt-get update -qq
        # Alone first: what it needs must come with it and not with the screen.
        inside apt-get install -y -qq --no-install-recommends /tmp/package.deb
        inside ldd $program/_internal/PySide6/Qt/plugins/platforms/libqxcb.so
        inside apt-get install -y -qq --no-install-recommends xvfb x11-utils shared-mime-info desktop-file-utils
    } >"$out/apt.log" 2>&1 || fail "apt: see $out/apt.log"
    ! grep -q "not found" "$out/apt.log" || fail "a library of the window is missing: see $out/apt.log"
    rm "$place/tmp/package.deb"
    inside useradd --create-home technician
    inside install -d -o technician -m 700 /tmp/runtime
    cp -r "$session" "$place$home/session"
    inside chown -R technician:technician $home
}

look_for_python() {
    found=$(find "$place/usr" "$place/bin" "$place/opt" \( -name 'python*' -o -name 'libpython*' \) -not -path "$place$program/*" \
        -not -path "$place/usr/share/*" 2>/dev/null || true)
    [ -z "$found" ] || fail "there is a Python: $found"
    say "No Python outside of the program."
}

seconds() { # COMMAND...: wall and processor seconds of a command of the user
    LC_ALL=C bash -c 'TIMEFORMAT="%R s, of the processor %U + %S s"; time "$@" >"'"$out"'/command.log" 2>&1' bash \
        chroot --userspec=technician:technician "$place" env -i PATH=/usr/bin:/bin HOME=$home USER=technician LANG=C.UTF-8 \
        sh -c 'cd && exec "$@"' sh "$@" 2>&1 || { cat "$out/command.log" >&2; fail "$*"; }
}

forget_files() { # nearly as after starting the machine: no larger file of the program is in memory
    sync
    find "$place$program" "$place/usr/lib/x86_64-linux-gnu" -type f -size +64k -exec dd if={} iflag=nocache count=0 status=none \;
}

commands() {
    forget_files
    say "gelpolight --version, cold: $(seconds gelpolight --version)"
    say "gelpolight --version, warm: $(seconds gelpolight --version)"
    grep -q "^gelpolight " "$out/command.log" || fail "it says no version"
    say "calibrate: $(seconds gelpolight calibrate session -o a.gplcal)"
    press=$(sed -n 2p "$session/presses/truth.csv" | cut -d , -f 1)
    rm -rf "$place$home/.cache/gelpolight/kernels"
    say "reconstruct one press, loops not compiled yet: $(seconds gelpolight reconstruct a.gplcal "session/presses/$press" -o first)"
    say "reconstruct one press, from then on: $(seconds gelpolight reconstruct a.gplcal "session/presses/$press" -o second)"
    say "reconstruct from another folder: $(seconds sh -c "cd /tmp && gelpolight reconstruct $home/a.gplcal $home/session/presses/$press -o /tmp/third")"
    cmp "$place$home/first/${press%.*}.npz" "$place$home/second/${press%.*}.npz" || fail "compiled loops give something else later"
    say "compiled loops are kept in: $(as_user du -sh .cache/gelpolight/kernels | tr '\t' ' ')"
    say "batch, two workers: $(seconds gelpolight batch a.gplcal session/presses -o batch --workers 2)"
    [ "$(find "$place$home/batch" -name '*.npz' | wc -l)" -ge 5 ] || fail "the batch has left frames out"
}

stop() { # PROCESS: as the desktop asks it to
    kill "$1" 2>/dev/null || true
    wait "$1" || fail "the window ended with status $?"
}

start() { # ARGUMENT...: the window; how long it took in ms, and of the processor
    began=$(date +%s%N)
    as_user gelpolight "$@" >"$out/window.log" 2>&1 &
    window=$!
    until inside env DISPLAY=$screen xwininfo -name "GelPoLight Studio" 2>/dev/null | grep -q IsViewable; do
        kill -0 $window 2>/dev/null || { cat "$out/window.log" >&2; fail "the window did not come"; }
    done
    took_ms=$((($(date +%s%N) - began) / 1000000))
    # Fields 14 and 15, in hundredths of a second; the name before them holds no blanks here.
    processor_ms=$(cut -d ' ' -f 14,15 /proc/$window/stat | awk '{print 10 * ($1 + $2)}')
}

median() { # NUMBER...
    printf '%s\n' "$@" | sort -n | sed -n "$((($# + 1) / 2))p"
}

starts() { # NAME [COMMAND BEFORE EACH]
    walls= processors=
    for _ in 1 2 3 4 5; do
        ${2:-true}
        start
        sleep 1
        stop $window
        walls="$walls $took_ms" processors="$processors $processor_ms"
    done
    # shellcheck disable=SC2086 # lists of numbers
    say "window on the screen, $1: median $(median $walls) ms ($walls ), of the processor $(median $processors) ms"
}

picture() { # NAME
    convert "xwd:$place/tmp/screen/Xvfb_screen0" "$out/$1.png"
    say "picture: $out/$1.png"
}

settle() {
    sleep "${SETTLE_S:-20}"
}

windows() {
    inside install -d -o technician /tmp/screen
    as_user Xvfb $screen -noreset -screen 0 1280x800x24 -fbdir /tmp/screen >"$out/xvfb.log" 2>&1 &
    server=$!
    trap 'kill $server 2>/dev/null' EXIT
    until inside env DISPLAY=$screen xwininfo -root >/dev/null 2>&1; do
        kill -0 $server || fail "no screen: see $out/xvfb.log"
    done

    step "opening a calibration as a desktop does"
    start a.gplcal
    say "the very first window: $took_ms ms"
    settle
    picture sensors
    stop $window
    kept=$(cd "$place$home" && find . -path '*/GelPoLight/sensors/*.gplcal')
    [ -n "$kept" ] || fail "the calibration is not in the library"
    library=${kept%%/sensors/*}
    echo "{\"in_use\": \"${kept#"$library"/}\"}" >"$place$home/$library/workspace.json"

    step "timing the start"
    starts "cold" forget_files
    starts "warm"

    step "showing a press in 3D"
    settings=$place$home/.config/gelpolight/desktop.ini
    mkdir -p "$place$home/one" && cp "$session/presses/$press" "$place$home/one/"
    printf '[source]\nkind=folder\nfile=%s/one\n' "$home" >>"$settings"
    inside chown -R technician:technician $home
    start
    tries=0
    until grep -q libvtkRenderingOpenGL2 /proc/$window/maps; do
        tries=$((tries + 1))
        [ $tries -le 600 ] || fail "nothing was drawn in 3D"
        sleep 1
    done
    settle
    picture inspect
    stop $window
    kill $server
    trap - EXIT
}

check_desktop() {
    inside desktop-file-validate /usr/share/applications/gelpolight.desktop || fail "the desktop entry is wrong"
    inside env XDG_DATA_DIRS=/usr/share grep -q gplcal /usr/share/mime/globs2 || fail "the file types are not known"
    say "The desktop knows: $(grep -h gelpolight "$place/usr/share/mime/globs2" "$place/usr/share/applications/mimeinfo.cache" | tr '\n' ' ')"
}

check_documentation() {
    [ -f "$place/usr/share/doc/gelpolight-studio/copyright" ] || fail "the licences are not there"
    pages=$(find -L "$place/usr/share/doc/gelpolight-studio/html" -name '*.html' | wc -l)
    [ "$pages" -ge 10 ] || fail "the documentation is not there"
    say "Documentation: $pages pages."
}

look_at_logs() {
    log=$(find "$place$home/.local" -name gelpolight.log)
    trouble=$(grep -hE " (WARNING|ERROR|CRITICAL) " "$log" || true)
    say "Warnings and errors in the log: ${trouble:-none}"
    faults=$(find "$place$home/.local" -name gelpolight-faults.log)
    [ -z "$faults" ] || say "Faults: $(cat "$faults")"
    written=$(find "$place$program" -newer "$place$home/session" -type f | head -n 3)
    [ -z "$written" ] || fail "it writes into its own folder: $written"
}

make_place
look_for_python
check_desktop
check_documentation
commands
windows
look_at_logs
say "Passed."
