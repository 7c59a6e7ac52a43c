#!/usr/bin/env bash
# Demonstrates Stridewire on a bare Debian 12. The script installs packages, builds the programs and
# starts a server with three worlds. In two of the worlds, a simulated game server moves avatars and
# a recorder writes one of them to a BVH file. Finally the script prints the address of the viewer,
# a web page that shows the avatars.
#
#   deploy/demo.sh                   # run until Ctrl-C
#   deploy/demo.sh --seconds 30      # stop after 30 seconds
#   deploy/demo.sh --library my.swl  # use this library in the second world
#
#   --seconds N      stop N seconds after the server has started (N >= 5)
#   --library FILE   a file written by `stridewire-library build`, or builtin
#   --no-build       use the programs in build/release/bin; install and build nothing
#
# World "generated" uses the library that Stridewire generates itself. World "captured" uses a
# library built from the two motion captures in Debian's package assimp-testmodels. With --library,
# this second world is named "given". World "slabs" has uneven ground, and no avatars at first. The
# script writes recordings, logs and settings to build/demo.
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
  bad_usage "--seconds: expected a whole number >= 5, got '$seconds'"
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
avatars=4    # Avatars per world.
record_s=20  # Length of the recordings. With --seconds they end at least 3 s before the demo.
[[ -z $seconds ]] || record_s=$((10#$seconds > 23 ? 20 : 10#$seconds - 3))
mkdir -p "$out"
rm -f "$out"/*.{bvh,log,toml}

# ---- install and build

if $build; then
  echo "Building Stridewire (log: $out/build.log). The first build takes several minutes."
  deploy/install_deps.sh --no-browser
  viewer=OFF
  if command -v npm >/dev/null; then viewer=ON; fi
  export CCACHE_BASEDIR="$root" CCACHE_NOHASHDIR=1
  { cmake --preset release -DSTRIDEWIRE_BUILD_VIEWER=$viewer &&
    # `cmake --install` also installs stridewire-load and the shared library.
    cmake --build --preset release --parallel "$(nproc)" --target "${programs[@]}" \
      stridewire-load stridewire_client_shared; } \
    >"$out/build.log" 2>&1 ||
    { tail -n 30 "$out/build.log" >&2; fail "the build failed; see $out/build.log"; }
  if [[ $viewer == OFF ]]; then
    echo "npm is not installed: the demo runs without the viewer."
  elif ! cmake --build --preset release --target viewer >"$out/viewer.log" 2>&1; then
    echo "The viewer could not be built: the demo runs without it. Is the npm registry reachable?" \
         "(log: $out/viewer.log)"
  fi
fi
for program in "${programs[@]}"; do
  [[ -x $bin/$program ]] || fail "$bin/$program does not exist; run without --no-build"
done

# ---- the library of the second world

world=captured
if [[ -n $library ]]; then
  world=given
else
  library=$root/$out/captured.swl
  for capture in 01_01 01_03; do
    [[ -r $captures/$capture.bvh ]] ||
      fail "$captures/$capture.bvh does not exist; install the package assimp-testmodels"
  done
  echo "Building a library from two captures (log: $out/library.log):"
  "$bin/stridewire-library" build --mirror --out "$library" "$captures"/{01_01,01_03}.bvh 2>&1 |
    tee "$out/library.log" | sed -n '/^[^ ]/s/^/    /p' || fail "could not build the library"
fi

# ---- start and stop processes; stop_all runs on every exit of the script

declare -A pids=()
order=()
ended=false
# start NAME LOG COMMAND...: runs a command in the background. The kernel sends it SIGTERM if this
# script is killed.
start() {
  local name=$1 log=$2
  shift 2
  setpriv --pdeathsig TERM "$@" >"$log" 2>&1 </dev/null &
  pids[$name]=$!
  order+=("$name")
}
alive() { kill -0 "${pids[$1]}" 2>/dev/null; }
# stop NAME SECONDS: sends SIGTERM, and SIGKILL after that many seconds. Returns the exit code.
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
# The viewer has the same address in every demo, unless another program uses the port.
http_port=7421
if (exec 3<>"/dev/tcp/127.0.0.1/$http_port") 2>/dev/null; then http_port=0; fi
# One slab per square metre, except near the origin, where the viewer spawns avatars.
LC_ALL=C awk 'BEGIN {
  printf "{\"boxes\":["
  for (i = -5; i <= 5; ++i) for (k = -5; k <= 5; ++k) {
    if (i * i + k * k < 3) continue
    printf "%s{\"min_m\":[%.2f,%.2f],\"max_m\":[%.2f,%.2f],\"height_m\":%.3f}", comma,
           i - 0.46, k - 0.46, i + 0.46, k + 0.46, 0.08 + 0.05 * sin(3.1 * i + 1.7 * k)
    comma = ","
  }
  print "]}" }' >"$out/slabs.json"
cat >"$out/stridewired.toml" <<TOML
# Written by deploy/demo.sh. With port 0 the server chooses a free port and prints it.
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
  alive server ||
    { tail -n 5 "$out/server.log" >&2; fail "the server did not start; see $out/server.log"; }
  sleep 0.1
done
address() { sed -n "s/^ready .*\b$1=\([^ ]*\).*/\1/p" <<<"$ready"; }
listen=$(address listen)
http=$(address http)
[[ -n $listen && -n $http ]] || fail "the server was not ready after 30 s; see $out/server.log"
began=$SECONDS
how_it_ends="Press Ctrl-C to stop the demo."
[[ -z $seconds ]] || how_it_ends="The demo stops after $seconds s."

# ---- a simulated game server and a recorder for each of two worlds

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
# The ranges match the two captures: they contain short steps and long jumps only.
play "$world" --step-m 0.35 0.55 --jump-m 0.8 1.05 --turn-rad 0.15 --home-m 1.5 --seed 2
sleep 1  # The server spawns the avatars within a few ticks.
watch generated
watch "$world"

cat <<TEXT

Stridewire is running. A simulated game server moves $avatars avatars in each of two worlds:
    generated   uses the library that Stridewire generates
    $(printf '%-9s' "$world")   uses ${library#"$root"/}
The world slabs has uneven ground and no avatars. Spawn one there in the viewer, choose "Walk there"
and click a slab.
Output:
    $out/{generated,$world}.bvh   recordings of avatar 1, $record_s s long
    $out/*.log   the logs of all programs
    http://$http/metrics   the server's metrics (also /healthz and /readyz)
Record another avatar:
    $bin/stridewire-record --connect $listen --world generated --avatar 2 --seconds 10 --out my.bvh
$how_it_ends
$(if [[ -f build/release/share/stridewire/viewer/index.html ]]; then
  echo "Libraries:  http://$http/library.html"
  echo "Viewer:     http://$http/"
else
  echo "The viewer was not built; http://$http/ explains how to build it."
fi)
TEXT

# ---- wait until the time is over, Ctrl-C is pressed or a process fails

while ! $ended && { [[ -z $seconds ]] || ((SECONDS - began < seconds)); }; do
  sleep 0.5 || true
  for name in server "game server of generated" "game server of $world"; do
    $ended || alive "$name" || fail "the $name stopped unexpectedly; see $out/*.log"
  done
done

# ---- stop everything and report

failed=0
report_failure() { echo "demo.sh: $*" >&2; failed=1; }
if $ended; then echo "Stopping."; fi
for name in generated "$world"; do
  stop "recorder of $name" 5 || $ended ||
    report_failure "the recorder of $name failed: $(tail -n 1 "$out/record_$name.log")"
  last_line="tail -n 1 $out/game_server_$name.log"
  if stop "game server of $name" 5; then
    $last_line  # The game server prints a summary of its requests last.
  else
    report_failure "the game server of $name failed: $($last_line)"
  fi
done
stop server 10 || report_failure "the server did not shut down cleanly; see $out/server.log"
for name in generated "$world"; do
  frames=$(sed -n 's/^Frames:[[:space:]]*\([0-9]*\).*/\1/p;/^Frame Time/q' \
    "$out/$name.bvh" 2>/dev/null || true)
  if [[ -n $frames ]] && ((frames > 0)); then
    echo "Recorded $out/$name.bvh: $frames frames."
  elif ! $ended; then
    report_failure "$out/$name.bvh has no frames; see $out/record_$name.log"
  fi
done
exit "$failed"
