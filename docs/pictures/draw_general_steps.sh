#!/bin/sh
# Draws stairs, a slalom and a shuffle, on the generated library and on libraries of captures. Draws
# a walk over stairs and a turn on the generated library.
#
#   docs/pictures/draw_general_steps.sh build/release/bin/stridewire-library CAPTURES
#
# CAPTURES contains the CMU subjects 03, 09, 14 and 16 as folders of BVH files.
set -eu
tool=$1
captures=$2
here=$(dirname "$0")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
draw() {  # CHOREOGRAPHY SUBJECTS TITLE [OPTION of draw_steps.py ...]
  name=$1 folders=$2 title=$3
  shift 3
  files=
  for folder in $folders; do files="$files $captures/$folder/*.bvh"; done
  # shellcheck disable=SC2086
  "$tool" build --all --mirror --out "$work/captured.swl" $files >/dev/null
  for library in builtin captured; do
    from=$library shown="generated library"
    [ $library = builtin ] || { from=$work/captured.swl shown="captures of CMU $folders"; }
    "$tool" synthesize "$from" --choreography "$here/$name.json" --out "$work/steps.bvh" >/dev/null
    "$here/draw_steps.py" "$work/steps.bvh" "$here/${name}_$library.svg" \
      --title "$title, $shown" "$@"
  done
}
draw stairs "03 14" "stairs of 0.2 m" --every 0.35 --ground feet
draw slalom "16" "slalom, 0.4 rad per step" --every 0.25
draw shuffle "09" "sideways shuffle" --front --every 0.3 --gap -0.55

draw_generated() {  # CHOREOGRAPHY TITLE [OPTION of draw_steps.py ...]
  name=$1 title=$2
  shift 2
  "$tool" synthesize builtin --choreography "$here/$name.json" --out "$work/steps.bvh" >/dev/null
  "$here/draw_steps.py" "$work/steps.bvh" "$here/${name}_builtin.svg" \
    --title "$title, generated library" "$@"
}
# The profile of the terrain in flight.json: places and heights.
profile=0,0,1,0,1,0.17,1.3,0.17,1.3,0.34,1.6,0.34,1.6,0.51,2.8,0.51,2.8,0.34
profile=$profile,3.1,0.34,3.1,0.17,3.4,0.17,3.4,0,4.6,0
draw_generated flight "a walk over stairs of 0.17 m" --every 0.4 --ground "$profile"
draw_generated turn "a turn of 180 degrees while walking" --every 0.6 --film
