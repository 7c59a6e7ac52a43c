#!/usr/bin/env bash
# Installs what is missing, builds, and runs every test through ctest. Works from any directory.
#
#   tests/run.sh                                # everything, optimised build
#   tests/run.sh --preset asan                  # the same under the address and UB sanitizers
#   tests/run.sh --label 'unit|integration'     # only tests with such a label
#   tests/run.sh -- -R Trig                     # whatever follows -- goes to ctest
#
#   --preset NAME    release (default), debug, asan or tsan: a preset of CMakePresets.json
#   --label REGEX    only tests whose label matches
#   --jobs N         compilers at once (default: one per processor); of tests of the release one more
#   --werror         a compiler warning is an error, as in .ci/run
#   --no-install     leave the machine's packages alone
set -euo pipefail

usage() { sed -n '2,/^set -euo/{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"; }
bad_usage() { echo "run.sh: $* (see --help)" >&2; exit 2; }

root=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/.." && pwd)
preset=release
label=
jobs=$(nproc)
install=true
configure=()
while [[ $# -gt 0 ]]; do
  case "$1" in
    --preset | --label | --jobs)
      [[ $# -ge 2 ]] || bad_usage "$1 needs a value"
      declare "${1#--}=$2"
      shift 2 ;;
    --werror) configure+=(-DSTRIDEWIRE_WARNINGS_AS_ERRORS=ON); shift ;;
    --no-install) install=false; shift ;;
    -h | --help) usage; exit 0 ;;
    --) shift; break ;;
    *) bad_usage "unknown option '$1'" ;;
  esac
done
[[ $jobs =~ ^[1-9][0-9]*$ ]] || bad_usage "--jobs needs a number, not '$jobs'"
case "$preset" in
  release | debug | asan | tsan) ;;
  *) bad_usage "no preset '$preset'; there are release, debug, asan and tsan" ;;
esac

cd "$root"
if $install; then deploy/install_deps.sh; fi

# Results may be shared between clones of the project: compilations see paths relative to its root.
export CCACHE_BASEDIR="$root" CCACHE_NOHASHDIR=1

# The web client and the viewer are the same however C++ is compiled: with one preset is enough.
if [[ $preset == release ]]; then
  if command -v npm >/dev/null; then configure+=(-DSTRIDEWIRE_BUILD_VIEWER=ON)
  else echo "run.sh: no npm here: the web client and the viewer are not tested" >&2; fi
fi

started=$SECONDS
cmake --preset "$preset" -DSTRIDEWIRE_BUILD_TESTS=ON "${configure[@]}"
cmake --build --preset "$preset" --parallel "$jobs"
built=$SECONDS

# Tests wait for servers, clocks and browsers most of their time; under sanitizers they compute.
test_jobs=$jobs
if [[ $preset == release ]]; then test_jobs=$((jobs + 1)); fi

# gcc 12's thread sanitizer does not know the addresses that newer kernels hand out at random.
fixed_addresses=()
if [[ $preset == tsan ]] && setarch -R true 2>/dev/null; then fixed_addresses=(setarch -R); fi

status=0
"${fixed_addresses[@]}" \
  ctest --preset "$preset" --parallel "$test_jobs" ${label:+--label-regex "$label"} "$@" 2>&1 |
  tee "build/$preset/ctest.txt" || status=$?

# ctest has said which tests failed; end with one line for whoever only sees the end.
totals=$(grep -E 'tests passed, [0-9]+ tests failed out of' "build/$preset/ctest.txt" | tail -n 1 || true)
echo
echo "$preset: build $((built - started)) s, tests $((SECONDS - built)) s," \
     "log build/$preset/Testing/Temporary/LastTest.log"
echo "${totals:-ctest ended with $status before it ran a test}"
exit "$status"
