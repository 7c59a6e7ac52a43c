#!/usr/bin/env bash
# example_config_test.sh STRIDEWIRED CONFIG.toml: checks that the server accepts the example
# configuration, that it contains every key, and that its values are the defaults, except for its
# worlds.
set -euo pipefail
stridewired=$1
config=$2
failed=0
complain() { echo "FAILED: $*" >&2; failed=1; }

# Environment variables would override the file.
for name in $(compgen -e STRIDEWIRE_ || true); do unset "$name"; done

"$stridewired" --config "$config" --check-config || complain "--check-config ended with $?"

settings() { sed '/^\[worlds/,$d'; }
defaults=$("$stridewired" --print-config | settings)
example=$("$stridewired" --config "$config" --print-config | settings)
[[ $defaults == "$example" ]] || {
  complain "the example says something else than the defaults:"
  diff <(echo "$defaults") <(echo "$example") >&2 || true
}

keys=$(sed -n 's/^\([a-z_0-9]*\) = .*/\1/p' <<<"$defaults")
[[ $(wc -w <<<"$keys") -ge 10 ]] || complain "--print-config names hardly any key: $keys"
for key in $keys; do
  grep -qE "^$key = " "$config" || complain "the example does not name $key"
done
exit "$failed"
