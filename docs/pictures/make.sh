#!/usr/bin/env bash
# Makes the pictures of this folder anew, from the synthetic sequence of the demo. It takes some minutes.
#
#     bash docs/pictures/make.sh
#
# MBA names another program than target/release/mba.
set -euo pipefail
pictures=$(cd "$(dirname "$0")" && pwd)
mba=${MBA:-$pictures/../../target/release/mba}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$mba" demo --out "$work/demo"

made=$work/demo/mapped-full
# The keyframe with the longest blur of those that the report shows, and the part of another where most is to be seen.
cp "$made/pictures/keyframe_4.png" "$pictures/keyframe.png"
cp "$made/pictures/detail_2.png" "$pictures/detail.png"
cp "$made/pictures/map.png" "$pictures/map.png"
cp "$made/plots/blur.svg" "$made/plots/trajectory_top.svg" "$pictures/"
