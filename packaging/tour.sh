#!/bin/sh
# A tour of the commands on the virtual sensor, from a bare machine on and without a screen: images, calibration,
# depth maps, sizes, evaluation.
set -eu
cd "$(dirname "$0")/.."
sh packaging/setup.sh commands

out=demo-output
session=$out/session
calibration=$out/virtual-sensor.gplcal

step() { # NUMBER TEXT COMMAND...
    echo
    echo "[$1/5] $2"
    shift 2
    echo "      gelpolight $*"
    .venv/bin/gelpolight "$@"
}

if [ -e "$out" ]; then
    echo "Removing the $out of an earlier run."
    rm -rf "$out"
fi
mkdir "$out"

step 1 "The virtual sensor takes the images of a calibration, and presses with their true sizes." \
    simulate "$session"
step 2 "The images become one calibration file; every stage says how good it is." \
    calibrate "$session" -o "$calibration" --json "$out/calibration.json"

# The first press of a known shape: truth.csv names the file and the shape in its first two columns.
truth=$session/presses/truth.csv
press=$(sed -n 2p "$truth" | cut -d , -f 1)
shape=$(sed -n 2p "$truth" | cut -d , -f 2)

step 3 "Presses become depth maps in millimetres: as numbers, as images, as surfaces for a 3D viewer." \
    reconstruct "$calibration" "$session/presses/$press" "$session/presses/object_coin.png" \
    "$session/presses/object_nut.png" -o "$out/depth" --format npz,ply,png
step 4 "What was pressed in is measured, and compared with its true size." \
    measure "$calibration" "$session/presses/$press" --shape "$shape" --truth "$truth" --json "$out/measurement.json"
step 5 "All presses are measured: the errors as a table, a figure and a report." \
    evaluate "$calibration" "$session/presses" -o "$out/evaluation"

echo
echo "Done. Everything is in $out; look at $out/depth/object_coin.ply and $out/evaluation/evaluation.png."
