#!/bin/bash
# Builds libraries from captures and reports on them and on the generated library. Prints the
# tables "Refinement and correction" and "Realism" of docs/measurements_archive.md, with more
# columns, and draws the pictures of docs/REPORT.md.
#
#     docs/pictures/report.sh CAPTURES OUT
#
# CAPTURES contains the CMU subjects 03, 14 and 16 as folders of BVH files. The script writes
# libraries, a folder per report and its numbers (OUT/NAME.json) to OUT. If KEEP is set, it copies
# the pictures that docs/REPORT.md shows to that folder.
set -euo pipefail
if [[ $# -ne 2 ]]; then echo "usage: $0 CAPTURES OUT" >&2; exit 2; fi
captures=$1 out=$2
tool=${STRIDEWIRE_LIBRARY:-$(dirname "$0")/../../build/release/bin/stridewire-library}
mkdir -p "$out"

# Copies the pictures that docs/REPORT.md shows, a small part of a report, to $KEEP.
keep() {  # NAME PICTURE ...
  local name=$1 picture
  shift
  [[ -n ${KEEP:-} ]] || return 0
  mkdir -p "$KEEP"
  for picture in "$@"; do cp "$out/$name/$picture.svg" "$KEEP/${name}_$picture.svg"; done
}

report() {  # NAME LIBRARY [FILE.bvh ...]
  local name=$1 library=$2
  shift 2
  "$tool" report "$library" --out "$out/$name" --json ${1:+--captures "$@"} > "$out/$name.json"
}

report builtin builtin
keep builtin 0_step_left_{error,pseudoexamples,examples,joints,timing} \
  walk_{slabs,stairs,slalom,shuffle}
"$tool" build --out "$out/16.swl" "$captures"/16/*.bvh
report 16 "$out/16.swl" "$captures"/16/*.bvh
keep 16 1_step_right_{error,pseudoexamples,examples,joints} \
  2_step_left_{error,sites} walk_{slabs,slalom}
"$tool" build --out "$out/01.swl" /usr/share/assimp/models/BVH/01_0[13].bvh
report 01 "$out/01.swl" /usr/share/assimp/models/BVH/01_0[13].bvh
"$tool" build --out "$out/03_14.swl" "$captures"/03/*.bvh "$captures"/14/*.bvh
report 03_14 "$out/03_14.swl" "$captures"/03/*.bvh "$captures"/14/*.bvh

python3 - "$out" <<'PYTHON'
import json, sys
print("| library, group | examples, parameters | before, max and mean mm | pseudoexamples "
      "| refined, max and mean mm | at the pseudoexamples, mm | corrected in 3 rounds, max mm "
      "| in 8 (3 for one or two parameters), max and mean mm "
      "| sum of &#124;w&#124; refined, corrected | condition number |")
print("| --- " * 10 + "|")
names = ["builtin", "16", "01", "03_14"]
reports = {name: json.load(open(f"{sys.argv[1]}/{name}.json")) for name in names}
for name in names:
    for g, group in enumerate(reports[name]["groups"]):
        before, after, corrected = group["before"], group["after"], group["corrected_error_m"]
        def mm(error): return f"{1000 * error['max']:.2f}, {1000 * error['mean']:.2f}"
        print(f"| {name}, {g} {group['kind']} | {group['examples']}, {len(group['parameters'])} "
              f"| {mm(before['error_m'])} | {group['pseudoexamples']} | {mm(after['error_m'])} "
              f"| {1000 * group['pseudoexample_error_m']:.5f} "
              f"| {1000 * corrected['max_in_3']:.3f} "
              f"| {1000 * corrected['max']:.3f}, {1000 * corrected['mean']:.4f} "
              f"| {after['weight_sum_max']:.2f}, {corrected['weight_sum_max']:.2f} "
              f"| {after['condition']:.0f} |")
print()
print("| captures, group | movements, parameters | synthesized, cm | nearest, cm "
      "| inverse distance, cm | better than nearest | better than inverse distance "
      "| planted, cm | foot, cm | keytimes, ms |")
print("| --- " * 10 + "|")
for name in names:
    for g, group in enumerate(reports[name].get("realism", [])):
        if not group["movements"]: continue
        methods = [group[m] for m in ("cardinal", "nearest", "inverse_distance")]
        cm = [100 * m["pose_m"] for m in methods]
        planted = ", ".join(f"{100 * m['planted_m']:.2f}" for m in methods)
        feet = ", ".join(f"{100 * m['foot_m']:.1f}" for m in methods)
        keys = ", ".join(f"{1000 * m['keytime_s']:.0f}" for m in methods)
        print(f"| {name}, {g} {group['kind']} | {group['movements']}, {group['parameters']} "
              f"| {cm[0]:.2f} | {cm[1]:.2f} | {cm[2]:.2f} | {100 * (1 - cm[0] / cm[1]):.0f} % "
              f"| {100 * (1 - cm[0] / cm[2]):.0f} % | {planted} | {feet} | {keys} |")
PYTHON
