#!/usr/bin/env bash
# Finds by bisection the largest number of wandering avatars that one server on this machine can
# handle at 60 Hz, and prints it. A crowd size passes if a run of stridewire-load fulfils no
# --fail-if condition. Each size has two attempts, because other programs can disturb a run.
# Measurements are printed to stderr.
#
#   tests/bench/largest_crowd.sh
#   tests/bench/largest_crowd.sh --from 5000 --to 40000 --within 500 --seconds 60
#   tests/bench/largest_crowd.sh --fail-if 'ticks_missed>0' --fail-if 'tick_ms.p99>10' \
#     -- --partial-observers 100
#
#   --from N, --to N  a crowd size that passes, and one that fails (default: 1000, 60000)
#   --within N        stop when the interval is this small (default: 500)
#   --seconds S       duration of each measurement (default: 20)
#   --shards N        number of shards of the server (default: 2)
#   --fail-if TEXT    condition of stridewire-load; can be repeated (default: ticks_missed>0)
#   --bin DIR         folder of the programs (default: build/release/bin)
#   -- OPTION ...     further options for stridewire-load (default: --observers 1)
set -euo pipefail

usage() { sed -n '2,/^set -euo/{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"; }
bad_usage() { echo "largest_crowd.sh: $* (see --help)" >&2; exit 2; }

root=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/../.." && pwd)
bin=$root/build/release/bin
from=1000 to=60000 within=500 seconds=20 shards=2
fail_ifs=()
more=()
while [[ $# -gt 0 ]]; do
  case "$1" in
    --from | --to | --within | --seconds | --shards)
      [[ $# -ge 2 && $2 =~ ^[1-9][0-9]*$ ]] || bad_usage "$1 needs a whole number above 0"
      declare "${1#--}=$2"
      shift 2 ;;
    --fail-if)
      [[ $# -ge 2 ]] || bad_usage "$1 needs a value"
      fail_ifs+=(--fail-if "$2")
      shift 2 ;;
    --bin) [[ $# -ge 2 ]] || bad_usage "$1 needs a value"; bin=$2; shift 2 ;;
    -h | --help) usage; exit 0 ;;
    --) shift; more=("$@"); break ;;
    *) bad_usage "unknown option '$1'" ;;
  esac
done
[[ $from -lt $to ]] || bad_usage "--from $from is not below --to $to"
[[ -x $bin/stridewired && -x $bin/stridewire-load ]] ||
  bad_usage "--bin $bin has no stridewired and stridewire-load"
[[ ${#fail_ifs[@]} -gt 0 ]] || fail_ifs=(--fail-if 'ticks_missed>0')
[[ " ${more[*]} " == *" --observers "* ]] || more+=(--observers 1)

# passes N: returns 0 if a new server can handle N avatars, else 1. Any other error ends the search.
passes() {
  local ready server result=0 output
  exec 3< <(exec "$bin/stridewired" --listen 127.0.0.1:0 --http 127.0.0.1:0 --shards "$shards" \
    --log-level error --max-avatars 100000 --max-avatars-per-world 100000 \
    --requests-per-s 1000000 --request-burst 1000000)
  server=$!
  read -r ready <&3 || { echo "largest_crowd.sh: stridewired did not start" >&2; exit 1; }
  output=$("$bin/stridewire-load" --connect "$(sed 's/.*listen=\([^ ]*\).*/\1/' <<<"$ready")" \
    --http "$(sed 's/.*http=\([^ ]*\).*/\1/' <<<"$ready")" --avatars "$1" --seconds "$seconds" \
    --wander --verify-one-in 20 "${fail_ifs[@]}" "${more[@]}" 2>&1) || result=$?
  kill "$server"
  exec 3<&-
  grep -E '^(server tick|ticks missed|step latency)' <<<"$output" | sed "s/^/$1: /" >&2 || true
  if [[ $result -gt 1 ]] || { [[ $result -eq 1 ]] && ! grep -q -- --fail-if <<<"$output"; }; then
    echo "largest_crowd.sh: $1 avatars: $output" >&2
    exit 1
  fi
  return "$result"
}

while [[ $((to - from)) -gt $within ]]; do
  middle=$(((from + to) / 2))
  if passes "$middle" || passes "$middle"; then from=$middle; else to=$middle; fi
done
echo "$from"
