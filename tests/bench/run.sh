#!/usr/bin/env bash
# Measures what movements, poses and messages cost on one core of this machine, prints a table and
# writes one CSV with commit, compiler and processor.
#
#   tests/bench/run.sh                       # builtin, and the captures of subject 16 if they are there
#   tests/bench/run.sh LIBRARY.swl ...       # builtin and these
#   tests/bench/run.sh --min-time 2 --filter synthesize
#
# Crowds of 100 to 100,000 are told as multiples of a floor as well, which is measured in the same run: what reading their
# bytes once and giving each float one multiply-add takes.
#
#   --out DIR        where the CSV goes (default: build/release/bench)
#   --min-time S     seconds for each benchmark (default: 0.5)
#   --filter REGEX   only benchmarks whose name matches
#   --no-build       the programs are built already
set -euo pipefail

usage() { sed -n '2,/^set -euo/{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"; }
bad_usage() { echo "run.sh: $* (see --help)" >&2; exit 2; }

root=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/../.." && pwd)
bin=$root/build/release/bin
out=$root/build/release/bench
min_time=0.5
filter=.
build=true
libraries=()
while [[ $# -gt 0 ]]; do
  case "$1" in
    --out | --min-time | --filter)
      [[ $# -ge 2 ]] || bad_usage "$1 needs a value"
      name=${1#--}
      declare "${name//-/_}=$2"
      shift 2 ;;
    --no-build) build=false; shift ;;
    -h | --help) usage; exit 0 ;;
    -*) bad_usage "unknown option '$1'" ;;
    *) [[ -r $1 ]] || bad_usage "cannot read '$1'"; libraries+=("$(realpath "$1")"); shift ;;
  esac
done
[[ $min_time =~ ^[0-9]+(\.[0-9]+)?$ ]] || bad_usage "--min-time needs a number, not '$min_time'"

if $build; then
  cmake -S "$root" --preset release >/dev/null
  cmake --build "$root/build/release" --target stridewire-bench stridewire-library >&2
fi
mkdir -p "$out"

captures=$root/../shared/mocap/cmu/16
if [[ ${#libraries[@]} -eq 0 && -d $captures ]]; then
  libraries=("$out/captured16.swl")
  "$bin/stridewire-library" build --all --out "${libraries[0]}" "$captures"/*.bvh >/dev/null
fi

commit=$(git -C "$root" rev-parse --short HEAD 2>/dev/null || echo unknown)
[[ -z $(git -C "$root" status --porcelain 2>/dev/null) ]] || commit+=-changed
compiler=$(sed -n 's/^CMAKE_CXX_COMPILER:[A-Z]*=//p' "$root/build/release/CMakeCache.txt")
compiler=$("$compiler" --version | head -n 1)
cpu=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1)
load=$(cut -d ' ' -f 1 /proc/loadavg)
csv=$out/$(date -u +%Y%m%dT%H%M%SZ)-$commit.csv

raw=$(mktemp)
trap 'rm -f "$raw"' EXIT
# One core, but for what measures several (shards): what else runs on this machine is told by its load average in the CSV.
bench() { "$@" --benchmark_min_time="$min_time" --benchmark_format=json "${libraries[@]}" >>"$raw"; }
all_names=$("$bin/stridewire-bench" --benchmark_list_tests "${libraries[@]}" | grep -E -- "$filter" || true)
one_of() { sed 's/[][\.*^$+?(){}|]/\\&/g' | paste -sd '|'; }
one_core=$({ grep -v '/shards/' <<<"$all_names" || true; } | one_of)
several=$({ grep '/shards/' <<<"$all_names" || true; } | one_of)
[[ -n $one_core$several ]] || bad_usage "no benchmark's name matches '$filter'"
[[ -z $one_core ]] || bench taskset -c 0 "$bin/stridewire-bench" --benchmark_filter="^($one_core)\$"
[[ -z $several ]] || bench "$bin/stridewire-bench" --benchmark_filter="^($several)\$"

# One benchmark is one object; its keys stand one a line.
awk -v commit="$commit" -v compiler="$compiler" -v cpu="$cpu" -v load="$load" -v csv="$csv" '
  function value(line) { sub(/^[^:]*: */, "", line); sub(/,$/, "", line); gsub(/"/, "", line); return line }
  function number(text) { return text == "" ? "" : sprintf("%.6g", text) }
  function quoted(text) { gsub(/"/, "\"\"", text); return "\"" text "\"" }
  BEGIN {
    print "benchmark,items_per_s,cpu_us,iterations,bytes_per_s,examples,parameters,library_bytes,bytes_per_example,times_floor,commit,compiler,cpu,load_average" > csv
    printf "%-40s %14s %12s %10s %12s\n", "one core of " cpu, "items/s", "us an item", "MB/s", "times floor"
  }
  /"benchmarks": \[/ { inside = 1; next }
  !inside { next }
  /^ *\{/ { split("", f) }
  /^ *"[a-z_]+":/ { key = $1; gsub(/[":]/, "", key); f[key] = value($0) }
  /^ *\}/ && ("name" in f) {
    if ("error_message" in f) { print f["name"] ": " f["error_message"] > "/dev/stderr"; failed = 1 }
    us = f["cpu_time"]
    items = f["items_per_second"] != "" ? f["items_per_second"] : 1e6 / us
    # Crowds are told beside the floor of as many, measured before them.
    times = ""
    if (f["name"] ~ /\/crowd\//) {
      size = f["name"]; sub(/.*\//, "", size)
      of = f["name"]; sub(/\/crowd\/.*/, "", of)
      if (f["name"] ~ /\/crowd\/floor\//) floor[of "/" size] = items
      if ((of "/" size) in floor) times = sprintf("%.2f", floor[of "/" size] / items)
    }
    print quoted(f["name"]) "," number(items) "," number(us) "," f["iterations"] "," \
          number(f["bytes_per_second"]) "," number(f["examples"]) "," number(f["parameters"]) "," \
          number(f["library_bytes"]) "," number(f["bytes_per_example"]) "," times "," \
          quoted(commit) "," quoted(compiler) "," quoted(cpu) "," load > csv
    if (f["library_bytes"] != "") {
      printf "%-40s %d bytes, %d examples, %.0f bytes an example\n", f["name"], f["library_bytes"], f["examples"], f["bytes_per_example"]
    } else {
      printf "%-40s %14.0f %12.4f %10s %12s\n", f["name"], items, 1e6 / items, \
             f["bytes_per_second"] != "" ? sprintf("%.0f", f["bytes_per_second"] / 1e6) : "", times
    }
    split("", f)
  }
  END { exit failed }' "$raw"
echo "load average $load, commit $commit, $compiler"
echo "written to $csv"
