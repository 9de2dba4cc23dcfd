#!/usr/bin/env bash
# Runs tracker, mapper, SLAM, meshes and views on two tiny synthetic sequences and prints a hash of every file that comes
# out. Two programs of the same behaviour print the same:
#
#   tests/same_bits.sh old/mba > old.txt
#   tests/same_bits.sh new/mba > new.txt
#   diff old.txt new.txt
#
# Takes the program and, if what was written shall be kept, a folder that is not there yet. Hashes are of files as they
# are, but for times, memory and paths in summary.json and times in frames.csv.
set -euo pipefail
[ $# -ge 1 ] || { sed -n '2,/^set/{/^set/!s/^# \{0,1\}//p}' "$0"; exit 2; }
mba=$(realpath "$1")
if [ $# -ge 2 ]; then
    mkdir "$2"
    place=$(realpath "$2")
else
    place=$(mktemp -d)
    trap 'rm -rf "$place"' EXIT
fi
cd "$place"

run() { "$mba" "$@" --quiet >/dev/null; }

# A shaken, blurred sequence; a loop that closes, whose rows are exposed one after the other.
run synth --out shake --size 160x120 --frames 12 --blur 4 --seed 3
run synth --out loop --path loop --size 160x120 --frames 120 --exposure 0.01 --blur 3 --readout 0.01 --seed 4

for data in shake loop; do
    run track "$data" --out "$data-track"
done
for field in gaussians triplane; do
    run map shake --trajectory shake-track --out "map-$field" --field "$field"
done
run slam shake --out slam
for run in map-gaussians map-triplane slam; do
    run mesh "$run" --out "$run.ply" --voxel-cm 4
    run mesh "$run" --out "$run.glb" --voxel-cm 4 --align shake/groundtruth.txt
    run render "$run" --poses shake/heldout_views/poses.txt --align shake/groundtruth.txt --out "$run-views"
done
run slam loop --out loop-slam --max-keyframes 40
grep -q '"loops": [1-9]' loop-slam/summary.json || { echo "no loop was closed" >&2; exit 1; }
"$mba" eval trajectory --reference loop/groundtruth.txt --estimate loop-slam/trajectory.txt --json >loop-slam.json
"$mba" eval images --reference shake/sharp --estimate map-gaussians/deblurred --captured shake --json >map.json

# Everything that a clock says, by its name in the two files that have such figures.
timeless() {
    case $1 in
        */summary.json) sed -E '/"milliseconds": \{/,/\}/d; /"(dataset|trajectory)": "/d; /"(seconds|peak_memory_bytes|.*per_second)":/d' "$1" ;;
        */frames.csv) awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == "ms") clock[i] = 1 }
            { for (i = 1; i <= NF; i++) printf "%s,", (i in clock) ? "" : $i; print "" }' "$1" ;;
        *) cat "$1" ;;
    esac
}
find . -type f ! -name lock ! -name checkpoint | LC_ALL=C sort | while read -r file; do
    printf '%s  %s\n' "$(timeless "$file" | sha256sum | cut -c 1-32)" "$file"
done
