#!/usr/bin/env bash
# Measures the cost of movements, poses and messages on one core of this machine. Prints a table and
# writes a CSV file that contains the commit, the compiler and the processor.
#
#   tests/bench/run.sh                       # builtin, and the captures of subject 16 if they exist
#   tests/bench/run.sh LIBRARY.swl ...       # builtin and these libraries
#   tests/bench/run.sh --min-time 2 --filter synthesize
#
# The script also prints the cost of crowds of 100 to 100,000 avatars as multiples of a floor, which
# it measures in the same run. The floor of crowds is the time to read their bytes once, with one
# multiply-add per float. The floor of observers is the time to pass their bytes to the system. On
# processors with AVX-512, crowds are measured with AVX2 as well.
#
#   --out PATH       CSV file that ends in .csv, or a folder (default: build/release/bench)
#   --min-time S     seconds per benchmark (default: 0.5)
#   --filter REGEX   run only benchmarks whose name matches
#   --no-build       use existing programs
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
csv=
if [[ $out == *.csv ]]; then
  csv=$(realpath -m "$out")
  out=$root/build/release/bench
  mkdir -p "$(dirname "$csv")"
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
[[ -n $csv ]] || csv=$out/$(date -u +%Y%m%dT%H%M%SZ)-$commit.csv

raw=$(mktemp)
trap 'rm -f "$raw"' EXIT
# Benchmarks use one core, except those of several shards. The CSV contains the load average, which
# shows whether other programs disturbed the run.
bench() {
  "$@" --benchmark_min_time="$min_time" --benchmark_format=json "${libraries[@]}" >>"$raw"
}
all_names=$("$bin/stridewire-bench" --benchmark_list_tests "${libraries[@]}" |
  grep -E -- "$filter" || true)
one_of() { sed 's/[][\.*^$+?(){}|]/\\&/g' | paste -sd '|'; }
one_core=$({ grep -v '/shards/' <<<"$all_names" || true; } | one_of)
several=$({ grep '/shards/' <<<"$all_names" || true; } | one_of)
[[ -n $one_core$several ]] || bad_usage "no benchmark's name matches '$filter'"
[[ -z $one_core ]] || bench taskset -c 0 "$bin/stridewire-bench" --benchmark_filter="^($one_core)\$"
crowds=$({ grep -E '/crowd/' <<<"$all_names" || true; } | one_of)
if [[ -n $crowds ]] && grep -q '"instruction_set": "AVX-512"' "$raw"; then
  bench taskset -c 0 "$bin/stridewire-bench" --instruction-set=AVX2 \
    --benchmark_filter="^($crowds)\$"
fi
# Runs with one and two shards alternate, so that other programs disturb both equally. The result of
# each is the median of five runs.
[[ -z $several ]] || bench "$bin/stridewire-bench" --benchmark_filter="^($several)\$" \
  --benchmark_repetitions=5 --benchmark_enable_random_interleaving=true \
  --benchmark_report_aggregates_only=true

# Each benchmark is one JSON object with one key per line.
awk -v commit="$commit" -v compiler="$compiler" -v cpu="$cpu" -v load="$load" -v csv="$csv" '
  function value(line) {
    sub(/^[^:]*: */, "", line); sub(/,$/, "", line); gsub(/"/, "", line)
    return line
  }
  function number(text) { return text == "" ? "" : sprintf("%.6g", text) }
  function quoted(text) { gsub(/"/, "\"\"", text); return "\"" text "\"" }
  BEGIN {
    print "benchmark,items_per_s,cpu_us,iterations,bytes_per_s,examples,parameters," \
          "library_bytes,bytes_per_example,times_floor,instruction_set,commit,compiler,cpu," \
          "load_average" > csv
    printf "%-40s %14s %12s %10s %12s\n", \
           "one core of " cpu, "items/s", "us per item", "MB/s", "times floor"
  }
  /^ *"instruction_set":/ {
    set = value($0)
    if (set != last_set) print set
    last_set = set
    next
  }
  /"benchmarks": \[/ { inside = 1; next }
  !inside { next }
  /^ *\{/ { split("", f) }
  /^ *"[a-z_]+":/ { key = $1; gsub(/[":]/, "", key); f[key] = value($0) }
  /^ *\}/ && f["run_type"] == "aggregate" && f["aggregate_name"] != "median" { split("", f) }
  /^ *\}/ && ("name" in f) {
    sub(/_median$/, "", f["name"])
    if ("error_message" in f) {
      print f["name"] ": " f["error_message"] > "/dev/stderr"
      failed = 1
    }
    name = f["name"]
    # Benchmarks with manual timing report processor time, which excludes the work of readers.
    us = sub(/\/manual_time$/, "", name) ? f["real_time"] : f["cpu_time"]
    items = f["items_per_second"] != "" ? f["items_per_second"] : 1e6 / us
    # PREFIX/KIND/SIZE is compared with PREFIX/floor/SIZE, which ran before it with the same
    # instruction set.
    times = ""
    if (match(name, /\/[^\/]+\/[^\/]+$/)) {
      split(substr(name, RSTART + 1), end, "/")
      of = substr(name, 1, RSTART - 1) "/" end[2]
      if (end[1] == "floor") floor[of] = items
      if (of in floor) times = sprintf("%.2f", floor[of] / items)
    }
    print quoted(name) "," number(items) "," number(us) "," f["iterations"] "," \
          number(f["bytes_per_second"]) "," number(f["examples"]) "," number(f["parameters"]) "," \
          number(f["library_bytes"]) "," number(f["bytes_per_example"]) "," times "," \
          quoted(set) "," quoted(commit) "," quoted(compiler) "," quoted(cpu) "," load > csv
    if (f["library_bytes"] != "") {
      printf "%-40s %d bytes, %d examples, %.0f bytes per example\n", \
             name, f["library_bytes"], f["examples"], f["bytes_per_example"]
    } else {
      printf "%-40s %14.0f %12.4f %10s %12s\n", name, items, 1e6 / items, \
             f["bytes_per_second"] != "" ? sprintf("%.0f", f["bytes_per_second"] / 1e6) : "", times
    }
    split("", f)
  }
  END { exit failed }' "$raw"
echo "load average $load, commit $commit, $compiler"
echo "written to $csv"
