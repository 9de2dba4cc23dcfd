#!/bin/sh
# Runs the workflow on a small synthetic recording, on this machine, and compares what comes out with the same commands by
# hand.
#
#     docs/workflow/test.sh target/release/mba
#
# Without Snakemake it is skipped; STRICT=true makes that a failure.
set -eu
mba=$(realpath "${1:?the program, e.g. target/release/mba}")
here=$(realpath "$(dirname "$0")")
if ! command -v snakemake > /dev/null; then
    echo "SKIPPED: there is no snakemake; python3 -m pip install snakemake" >&2
    test "${STRICT:-false}" != true
    exit
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
"$mba" synth --frames 18 --size 96x72 --blur 2 --out flat --quiet > /dev/null
mkdir flow hand
options="--group-keyframes 8 --keyframe-motion 0"
(
    cd flow
    snakemake --snakefile "$here/Snakefile" --profile "$here/profiles/local" --quiet all \
        --config mba="$mba" recordings="$work/flat" split_options="$options" mesh_options="--voxel-cm 4"
)
"$mba" track flat --out hand/run --quiet > /dev/null
# shellcheck disable=SC2086 # options are several words
"$mba" split hand/run --out hand/job $options --quiet > /dev/null
"$mba" map hand/job --jobs 1 --quiet > /dev/null
"$mba" merge hand/job --out hand/whole --quiet > /dev/null
for name in map.ply exposures.txt trajectory.txt; do
    cmp "flow/flat/whole/$name" "hand/whole/$name"
done
test -s flow/flat/mesh.ply
test -s flow/flat/whole/report.html
echo "the workflow gives the same map as its commands by hand"
