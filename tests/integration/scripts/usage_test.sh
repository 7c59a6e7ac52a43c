#!/usr/bin/env bash
# usage_test.sh ROOT: checks that every script prints its usage with --help, and rejects an unknown
# option with exit code 2 and one sentence that contains the option.
set -euo pipefail
cd "$1"
failed=0
complain() { echo "FAILED: $*" >&2; failed=1; }

for script in deploy/install_deps.sh deploy/demo.sh tests/run.sh tests/bench/largest_crowd.sh \
              .ci/bare_root .ci/tidy; do
  [[ -x $script ]] || complain "$script is not executable"
  bash -n "$script" || complain "$script does not parse"
  help=$("$script" --help) || complain "$script --help ended with $?"
  [[ $help == *"$(basename "$script")"* ]] || complain "$script --help does not show how to call it"

  result=0
  message=$("$script" --no-such-option 2>&1 >/dev/null) || result=$?
  [[ $result -eq 2 ]] || complain "$script --no-such-option ended with $result, not 2"
  [[ $message == *--no-such-option* ]] || complain "$script does not name the option: $message"
  [[ $(wc -l <<<"$message") -eq 1 ]] || complain "$script printed more than one line: $message"
done

# Options without a value, and invalid values.
refuses() {
  local result=0 message
  message=$("$@" 2>&1 >/dev/null) || result=$?
  [[ $result -eq 2 ]] || complain "$* ended with $result, not 2: $message"
}
refuses tests/run.sh --preset
refuses tests/run.sh --preset fast
refuses tests/run.sh --jobs many
refuses tests/bench/largest_crowd.sh --from
refuses tests/bench/largest_crowd.sh --from many
refuses tests/bench/largest_crowd.sh --from 9 --to 3
refuses deploy/demo.sh --seconds
refuses deploy/demo.sh --seconds soon
refuses deploy/demo.sh --library
refuses deploy/demo.sh --library /nonexistent.swl
exit "$failed"
