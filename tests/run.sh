#!/usr/bin/env bash
# Installs missing packages, builds Stridewire and runs its tests with ctest. The script can be
# called from any directory.
#
#   tests/run.sh                             # every test, release build
#   tests/run.sh --preset asan               # with the address and undefined-behaviour sanitizers
#   tests/run.sh --label 'unit|integration'  # only tests with a matching label
#   tests/run.sh -- -R Trig                  # arguments after -- are passed to ctest
#
#   --preset NAME    release (default), debug, asan or tsan; see CMakePresets.json
#   --label REGEX    run only tests whose label matches: unit, integration, fuzz, web, browser
#   --jobs N         compilers and tests to run in parallel (default: one per processor)
#   --werror         treat compiler warnings as errors, as .ci/run does
#   --no-install     do not install packages
#
# The last line contains the totals that ctest prints, the number of skipped tests, and what to do
# to run these.
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
[[ $jobs =~ ^[1-9][0-9]*$ ]] || bad_usage "--jobs: expected a number above 0, got '$jobs'"
case "$preset" in
  release | debug | asan | tsan) ;;
  *) bad_usage "--preset: expected release, debug, asan or tsan, got '$preset'" ;;
esac

cd "$root"
if $install; then deploy/install_deps.sh; fi

# With paths relative to the root, ccache can share results between clones of the project.
export CCACHE_BASEDIR="$root" CCACHE_NOHASHDIR=1

# The web client and the viewer do not depend on how C++ is compiled, so one preset tests them.
with_npm=true
if [[ $preset == release ]]; then
  if command -v npm >/dev/null; then configure+=(-DSTRIDEWIRE_BUILD_VIEWER=ON)
  else with_npm=false; fi
fi

started=$SECONDS
cmake --preset "$preset" -DSTRIDEWIRE_BUILD_TESTS=ON "${configure[@]}"
cmake --build --preset "$preset" --parallel "$jobs"
built=$SECONDS

# Most tests wait for servers, clocks and browsers, so one more than there are processors can run.
# Under sanitizers the tests are limited by the processors.
test_jobs=$jobs
if [[ $preset == release ]]; then test_jobs=$((jobs + 1)); fi

# The thread sanitizer of gcc 12 fails on newer kernels unless address randomisation is off.
fixed_addresses=()
if [[ $preset == tsan ]] && setarch -R true 2>/dev/null; then fixed_addresses=(setarch -R); fi

status=0
"${fixed_addresses[@]}" \
  ctest --preset "$preset" --parallel "$test_jobs" ${label:+--label-regex "$label"} "$@" 2>&1 |
  tee "build/$preset/ctest.txt" || status=$?

# Prints the names of the tests that ctest skipped.
skipped_tests() {
  sed -n '/^The following tests did not run:/,/^$/p' "build/$preset/ctest.txt" |
    sed -nE 's/^[[:space:]]+[0-9]+ - (.*) \(Skipped\)$/\1/p'
}
# Prints what the skipped tests reported: why they were skipped.
skip_reasons() {
  skipped_tests | awk '
    NR == FNR { skipped[$0]; next }
    /^[0-9]+\/[0-9]+ Testing: / { name = $0; sub(/^[^:]*: /, "", name) }
    /^Output:$/ { is_output = 1; next }
    /^<end of output>$/ { is_output = 0 }
    is_output && name in skipped && !/^\[|^Note:/' \
    - "build/$preset/Testing/Temporary/LastTest.log"
}
# Prints what to do to run the skipped tests, in one line.
skip_hints() {
  local reasons captures hints=
  reasons=$(skip_reasons)
  captures=$(grep -i 'captures' <<<"$reasons" || true)
  if grep -q 'assimp-testmodels' <<<"$reasons"; then
    hints="run deploy/install_deps.sh; "
  elif grep -qi 'chromium' <<<"$reasons"; then
    hints="run deploy/install_deps.sh without --no-browser; "
  fi
  if grep -qv 'assimp-testmodels' <<<"${captures:-assimp-testmodels}"; then
    hints+="copy BVH files of mocap.cs.cmu.edu to ../shared/mocap/cmu, one folder per subject; "
  fi
  hints=${hints:-see the reasons in the log; }
  echo "${hints%; }"
}

totals=$(grep -E 'tests passed, [0-9]+ tests failed out of' "build/$preset/ctest.txt" |
  tail -n 1 || true)
skipped=$(skipped_tests | wc -l)
echo
echo "$preset: build $((built - started)) s, tests $((SECONDS - built)) s," \
     "log build/$preset/Testing/Temporary/LastTest.log"
if ! $with_npm; then
  echo "npm is not installed, so the tests of the web client and the viewer were not built:" \
       "run deploy/install_deps.sh"
fi
hint=
if ((skipped > 0)); then hint=" (to run them: $(skip_hints))"; fi
# Scripts parse the last line. It begins like the one that ctest prints.
echo "${totals:-ctest ended with exit code $status before it ran a test}, $skipped skipped$hint"
exit "$status"
