#!/usr/bin/env bash
# Shows Stridewire on a bare Debian 12: installs, builds, starts a server with two worlds, lets a
# simulated game server move avatars in both, and records one avatar of each to BVH. Ends with the
# link of the page that shows them.
#
#   deploy/demo.sh                  # until Ctrl-C
#   deploy/demo.sh --seconds 30     # ends by itself
#   deploy/demo.sh --library my.swl # the second world plays this library instead
#
#   --seconds N      stop N seconds after the server is up (at least 5)
#   --library FILE   a library of stridewire-library build, or builtin
#   --no-build       use build/release/bin as it is: install and build nothing
#
# World "generated" plays the library that Stridewire generates itself. World "captured" plays one
# that is built first, from two motion captures of Debian's package assimp-testmodels.
# Everything it writes is in build/demo.
set -euo pipefail

usage() { sed -n '2,/^set -euo/{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"; }
bad_usage() { echo "demo.sh: $* (see --help)" >&2; exit 2; }
fail() { echo "demo.sh: $*" >&2; exit 1; }

root=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/.." && pwd)
seconds=
library=
build=true
while [[ $# -gt 0 ]]; do
  case "$1" in
    --seconds | --library)
      [[ $# -ge 2 ]] || bad_usage "$1 needs a value"
      declare "${1#--}=$2"
      shift 2 ;;
    --no-build) build=false; shift ;;
    -h | --help) usage; exit 0 ;;
    *) bad_usage "unknown option '$1'" ;;
  esac
done
if [[ -n $seconds ]] && { [[ ! $seconds =~ ^[0-9]{1,6}$ ]] || ((10#$seconds < 5)); }; then
  bad_usage "--seconds needs a whole number from 5 on, not '$seconds'"
fi
if [[ -n $library && $library != builtin ]]; then
  [[ -r $library ]] || bad_usage "--library: cannot read '$library'"
  library=$(readlink -f "$library")
fi

cd "$root"
out=build/demo
bin=build/release/bin
captures=/usr/share/assimp/models/BVH
programs=(stridewired stridewire-library stridewire-record sample_game_server)
avatars=4    # in each world
record_s=20  # or, with --seconds, till shortly before the end
[[ -z $seconds ]] || record_s=$((10#$seconds > 23 ? 20 : 10#$seconds - 3))
mkdir -p "$out"
rm -f "$out"/*.{bvh,log,toml}

# ---- install and build

if $build; then
  echo "Installing what is missing and building; the first time takes some minutes."
  deploy/install_deps.sh --no-browser
  viewer=OFF
  if command -v npm >/dev/null; then viewer=ON; fi
  export CCACHE_BASEDIR="$root" CCACHE_NOHASHDIR=1
  { cmake --preset release -DSTRIDEWIRE_BUILD_VIEWER=$viewer &&
    cmake --build --preset release --parallel "$(nproc)" --target "${programs[@]}"; } \
    >"$out/build.log" 2>&1 || { tail -n 30 "$out/build.log" >&2; fail "building failed, see $out/build.log"; }
  if [[ $viewer == OFF ]]; then
    echo "There is no npm: going on without the viewer."
  elif ! cmake --build --preset release --target viewer >"$out/viewer.log" 2>&1; then
    echo "The viewer was not built (see $out/viewer.log; is the npm registry reachable?): going on without it."
  fi
fi
for program in "${programs[@]}"; do
  [[ -x $bin/$program ]] || fail "there is no $bin/$program"
done

# ---- the library of the second world

world=captured
if [[ -n $library ]]; then
  world=given
else
  library=$root/$out/captured.swl
  for capture in 01_01 01_03; do
    [[ -r $captures/$capture.bvh ]] || fail "no $captures/$capture.bvh; it comes with the package assimp-testmodels"
  done
  echo "Building a library from two captures; $out/library.log tells what was left out and why:"
  "$bin/stridewire-library" build --mirror --out "$library" "$captures"/{01_01,01_03}.bvh 2>&1 |
    tee "$out/library.log" | sed -n '/^[^ ]/s/^/    /p' || fail "building the library failed"
fi

# ---- every process is ended, on every way out

declare -A pids=()
order=()
ended=false
# start NAME LOG COMMAND...: in the background; it also ends should this script be killed outright.
start() {
  local name=$1 log=$2
  shift 2
  setpriv --pdeathsig TERM "$@" >"$log" 2>&1 </dev/null &
  pids[$name]=$!
  order+=("$name")
}
alive() { kill -0 "${pids[$1]}" 2>/dev/null; }
# stop NAME SECONDS: asks it to end, makes it end after that time; its exit code.
stop() {
  local pid=${pids[$1]:-} i result=0
  [[ -n $pid ]] || return 0
  unset "pids[$1]"
  kill -TERM "$pid" 2>/dev/null || true
  for ((i = 0; i < $2 * 10; ++i)); do kill -0 "$pid" 2>/dev/null || break; sleep 0.1; done
  kill -KILL "$pid" 2>/dev/null || true
  wait "$pid" 2>/dev/null || result=$?
  return "$result"
}
stop_all() {
  local i
  for ((i = ${#order[@]} - 1; i >= 0; --i)); do stop "${order[i]}" 3 || true; done
}
trap stop_all EXIT
trap 'ended=true' INT TERM HUP

# ---- the server

quoted_library=${library//\\/\\\\}
quoted_library=${quoted_library//\"/\\\"}
slabs=$root/$out/slabs.json
quoted_slabs=${slabs//\\/\\\\}
quoted_slabs=${quoted_slabs//\"/\\\"}
# The page keeps its address from one demonstration to the next, unless somebody else is there.
http_port=7421
if (exec 3<>"/dev/tcp/127.0.0.1/$http_port") 2>/dev/null; then http_port=0; fi
# Slabs of a metre, none where avatars are put.
LC_ALL=C awk 'BEGIN {
  printf "{\"boxes\":["
  for (i = -5; i <= 5; ++i) for (k = -5; k <= 5; ++k) {
    if (i * i + k * k < 3) continue
    printf "%s{\"min_m\":[%.2f,%.2f],\"max_m\":[%.2f,%.2f],\"height_m\":%.3f}", comma, i - 0.46, k - 0.46,
           i + 0.46, k + 0.46, 0.08 + 0.05 * sin(3.1 * i + 1.7 * k)
    comma = ","
  }
  print "]}" }' >"$out/slabs.json"
cat >"$out/stridewired.toml" <<TOML
# Made by deploy/demo.sh. Port 0 is any free port; the server tells which it took.
listen = "127.0.0.1:0"
http = "127.0.0.1:$http_port"

[worlds.generated]
library = "builtin"

[worlds.$world]
library = "$quoted_library"

[worlds.slabs]
library = "builtin"
terrain = "$quoted_slabs"
TOML
start server "$out/server.log" "$bin/stridewired" --config "$out/stridewired.toml"
ready=
for ((i = 0; i < 300; ++i)); do
  ready=$(grep -sm 1 '^ready ' "$out/server.log" || true)
  [[ -z $ready ]] || break
  alive server || { tail -n 5 "$out/server.log" >&2; fail "the server did not start, see $out/server.log"; }
  sleep 0.1
done
address() { sed -n "s/^ready .*\b$1=\([^ ]*\).*/\1/p" <<<"$ready"; }
listen=$(address listen)
http=$(address http)
[[ -n $listen && -n $http ]] || fail "the server was not ready after 30 s, see $out/server.log"
began=$SECONDS

# ---- a simulated game server for each world, and someone who watches one avatar of each

play() {
  local name=$1
  shift
  start "game server of $name" "$out/game_server_$name.log" "$bin/sample_game_server" \
    --connect "$listen" --world "$name" --avatars "$avatars" --report-s 60 "$@"
}
watch() {
  start "recorder of $1" "$out/record_$1.log" "$bin/stridewire-record" --connect "$listen" \
    --world "$1" --avatar 1 --seconds "$record_s" --out "$out/$1.bvh"
}
play generated --step-m 0.3 0.7 --jump-m 0.4 1.3 --turn-rad 0.3 --home-m 1.5 --seed 1
# Asked for no more than those two captures span: its walks are short and its jumps long.
play "$world" --step-m 0.35 0.55 --jump-m 0.8 1.05 --turn-rad 0.15 --home-m 1.5 --seed 2
sleep 1  # The avatars are there within a few ticks.
watch generated
watch "$world"

cat <<TEXT

Stridewire is up. Two worlds of $avatars avatars each walk, stop, stand, jump and start again, as a simulated game
server asks them to:
    generated   moves by the library that Stridewire generates itself
    $(printf '%-9s' "$world")   moves by ${library#"$root"/}
A third, slabs, has uneven ground and nobody on it yet: spawn somebody there in the page, choose "Send there" and click on a slab.
Where to look:
    $out/generated.bvh, $out/$world.bvh   avatar 1 of each for $record_s s; opens in Blender and most 3D tools
    http://$http/metrics   the server's figures (and /healthz, /readyz)
    $out/*.log   what everybody says
To watch another:
    $bin/stridewire-record --connect $listen --world generated --avatar 2 --seconds 10 --out my.bvh
$([[ -n $seconds ]] && echo "Ends by itself after $seconds s." || echo "Ctrl-C ends it.")

$(if [[ -f build/release/share/stridewire/viewer/index.html ]]; then
  echo "What the libraries span:   http://$http/library.html"
  echo "See them walk:             http://$http/"
else
  echo "No viewer was built; http://$http/ says how."
fi)

TEXT

# ---- until it is time, or somebody has had enough, or something is wrong

# Reports of the game servers, as they come.
declare -A shown=([generated]=0 [$world]=0)
report() {
  local name lines
  for name in generated "$world"; do
    lines=$(wc -l <"$out/game_server_$name.log")
    if ((lines > shown[$name])); then tail -n 1 "$out/game_server_$name.log"; fi
    shown[$name]=$lines
  done
}
while ! $ended && { [[ -z $seconds ]] || ((SECONDS - began < seconds)); }; do
  sleep 0.5 || true
  $ended || report
  for name in server "game server of generated" "game server of $world"; do
    $ended || alive "$name" || fail "the $name ended early, see $out/*.log"
  done
done

# ---- what came of it

failed=0
complain() { echo "demo.sh: $*" >&2; failed=1; }
if $ended; then
  echo
  echo "Ending."
fi
for name in generated "$world"; do
  stop "recorder of $name" 5 || $ended || complain "the recorder failed: $(tail -n 1 "$out/record_$name.log")"
  stop "game server of $name" 5 || complain "the game server of $name failed: $(tail -n 1 "$out/game_server_$name.log")"
done
report
stop server 10 || complain "the server did not end in order, see $out/server.log"
for name in generated "$world"; do
  frames=$(sed -n 's/^Frames:[[:space:]]*\([0-9]*\).*/\1/p;/^Frame Time/q' "$out/$name.bvh" 2>/dev/null || true)
  if [[ -n $frames ]] && ((frames > 0)); then
    echo "Recorded $out/$name.bvh: $frames frames."
  elif ! $ended; then
    complain "nothing was recorded of $name, see $out/record_$name.log"
  fi
done
exit "$failed"
