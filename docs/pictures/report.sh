#!/bin/bash
# Builds libraries from captures and reports of them and of the generated one; the tables of docs/measurements.md
# ("Refinement and correction", "Realism") and the pictures of docs/REPORT.md come from here.
#
#     docs/pictures/report.sh CAPTURES OUT
#
# CAPTURES holds the CMU subjects as folders (01, 03, 14, 16) of BVH files; OUT gets libraries, a folder for each
# report and its numbers (OUT/NAME.json). KEEP, a folder: gets the pictures docs/REPORT.md shows.
set -euo pipefail
if [[ $# -ne 2 ]]; then echo "usage: $0 CAPTURES OUT" >&2; exit 2; fi
captures=$1 out=$2
tool=${STRIDEWIRE_LIBRARY:-$(dirname "$0")/../../build/release/bin/stridewire-library}
mkdir -p "$out"

# Small enough for the project page: those docs/REPORT.md shows.
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
keep builtin 0_step_left_{error,pseudoexamples,examples,joints,timing} walk_{slabs,stairs,slalom,shuffle}
"$tool" build --out "$out/16.swl" "$captures"/16/*.bvh
report 16 "$out/16.swl" "$captures"/16/*.bvh
keep 16 1_step_right_{error,pseudoexamples,examples,joints} 2_step_left_{error,sites} walk_{slabs,slalom}
"$tool" build --out "$out/01.swl" /usr/share/assimp/models/BVH/01_0[13].bvh
report 01 "$out/01.swl" /usr/share/assimp/models/BVH/01_0[13].bvh
"$tool" build --out "$out/03_14.swl" "$captures"/03/*.bvh "$captures"/14/*.bvh
report 03_14 "$out/03_14.swl" "$captures"/03/*.bvh "$captures"/14/*.bvh

python3 - "$out" <<'PYTHON'
import json, sys
print("| library, group | examples, parameters | before, max and mean mm | pseudoexamples | refined, max and mean mm "
      "| at them, mm | corrected in 3 rounds, max mm | in 8 (3 for one or two parameters), max and mean mm "
      "| Σ&#124;w&#124; refined, corrected | condition |")
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
              f"| {after['weight_sum_max']:.2f}, {corrected['weight_sum_max']:.2f} | {after['condition']:.0f} |")
print()
print("| captures, group | movements, parameters | made, cm | nearest, cm | inverse distance, cm | under nearest | under inverse "
      "distance | foot, cm | keytimes, ms |")
print("| --- " * 9 + "|")
for name in names:
    for g, group in enumerate(reports[name].get("realism", [])):
        if not group["movements"]: continue
        cm = [100 * group[m]["pose_m"] for m in ("cardinal", "nearest", "inverse_distance")]
        feet = ", ".join(f"{100 * group[m]['foot_m']:.1f}" for m in ("cardinal", "nearest", "inverse_distance"))
        keys = ", ".join(f"{1000 * group[m]['keytime_s']:.0f}" for m in ("cardinal", "nearest", "inverse_distance"))
        print(f"| {name}, {g} {group['kind']} | {group['movements']}, {group['parameters']} | {cm[0]:.2f} | {cm[1]:.2f} "
              f"| {cm[2]:.2f} | {100 * (1 - cm[0] / cm[1]):.0f} % | {100 * (1 - cm[0] / cm[2]):.0f} % | {feet} | {keys} |")
PYTHON
