#!/bin/sh
# Plays the same choreographies with two versions of stridewire-library, and draws both results
# into this folder. The pictures in README.md compare commit a712f16 with the newest version.
#
#   docs/pictures/draw_before_after.sh OLD_TOOL NEW_TOOL CAPTURES
#
# CAPTURES contains the CMU subjects 05 and 16 as folders of BVH files.
set -eu
old=$1
new=$2
captures=$3
here=$(dirname "$0")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for subject in 05 16; do
  "$old" build --mirror --out "$work/old_$subject.swl" "$captures/$subject"/*.bvh >/dev/null
  "$new" build --mirror --out "$work/new_$subject.swl" "$captures/$subject"/*.bvh >/dev/null
done

draw() {  # NAME LIBRARY CHOREOGRAPHY TITLE [OPTION of draw_before_after.py ...]
  name=$1 library=$2 choreography=$3 title=$4
  shift 4
  for version in old new; do
    from=$work/${version}_$library.swl
    [ "$library" = builtin ] && from=builtin
    if [ $version = old ]; then tool=$old; else tool=$new; fi
    "$tool" synthesize "$from" --choreography "$choreography" --out "$work/$version.bvh" >/dev/null
  done
  "$here/draw_before_after.py" "$work/old.bvh" "$work/new.bvh" \
    "$here/before_after_${name}_$library.svg" --title "$title" "$@"
}

repeat() {  # COUNT LENGTH_M: steps of equal length, the first with the right foot
  steps="{\"step\": {\"foot\": \"right\", \"length_m\": $2}}"
  for _ in $(seq 2 "$1"); do steps="$steps, {\"step\": {\"length_m\": $2}}"; done
  echo "$steps"
}
echo "{\"movements\": [$(repeat 8 0.6)]}" >"$work/level.json"
echo "{\"movements\": [$(repeat 6 -0.3)]}" >"$work/back.json"
echo "{\"movements\": [$(repeat 4 0.6), {\"stand\": {\"seconds\": 1}}]}" >"$work/stop.json"
echo '{"movements": [{"stand": {"seconds": 8}}]}' >"$work/stand.json"
echo '{"movements": [{"walk_to": {"position_m": [0, 0, 3.5], "heading_rad": 0}}]}' \
  >"$work/goal.json"
echo "{\"movements\": [$(repeat 4 0.6),
  {\"walk_to\": {\"position_m\": [0, 0, -3], \"heading_rad\": 3.1416}}]}" >"$work/behind.json"
echo '{"movements": [{"walk_to": {"position_m": [3.5, 0, 0], "heading_rad": 0}}]}' \
  >"$work/side.json"

# The profile of the terrain in flight.json: places and heights.
profile=0,0,1,0,1,0.17,1.3,0.17,1.3,0.34,1.6,0.34,1.6,0.51,2.8,0.51,2.8,0.34
profile=$profile,3.1,0.34,3.1,0.17,3.4,0.17,3.4,0,4.6,0
stairs="walk_to over stairs of 0.17 m"
draw stairs builtin "$here/flight.json" "$stairs, generated library" --ground "$profile"
draw stairs_knee 16 "$here/flight.json" "$stairs, captures of CMU 16" --curve knee
draw goal 05 "$work/goal.json" "walk_to 3.5 m ahead, captures of CMU 05"
draw stop_speed 05 "$work/stop.json" "four steps, then a stand, captures of CMU 05" --curve speed
draw stand_sway 16 "$work/stand.json" "standing for 8 s, captures of CMU 16" --curve sway
draw back 16 "$work/back.json" "six steps of -0.3 m, captures of CMU 16"
draw pelvis builtin "$work/level.json" "steps of 0.6 m, generated library" --curve height
draw level_knee builtin "$work/level.json" "steps of 0.6 m, generated library" --curve knee
draw level_knee 16 "$work/level.json" "steps of 0.6 m, captures of CMU 16" --curve knee
back="four steps, then walk_to 3 m behind"
draw turn_heading builtin "$work/behind.json" "$back, generated library" --curve heading
draw turn_heading 16 "$work/behind.json" "$back, captures of CMU 16" --curve heading
draw side_distance 16 "$work/side.json" "walk_to 3.5 m to the left, captures of CMU 16" \
  --curve distance
