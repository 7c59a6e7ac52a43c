#!/usr/bin/env bash
# Installs the Debian 12 packages that are needed to build, test and demonstrate Stridewire.
# The script asks no questions and can be run again at any time. It returns at once if all packages
# are installed already.
#
#   deploy/install_deps.sh               # everything for the build, the tests and the demo
#   deploy/install_deps.sh --lint        # also the linters and debootstrap, which .ci/run needs
#   deploy/install_deps.sh --no-browser  # without Chromium, which only the viewer's tests need
#   deploy/install_deps.sh --list        # print the package names, one per line, and exit
#
# The output of apt-get goes to a log file in $TMPDIR (default: /tmp). The script prints the name of
# this file.
set -euo pipefail

build=(
  ca-certificates
  ccache
  cmake
  flatbuffers-compiler
  g++
  git
  gnuplot-nox  # Draws the pictures of `stridewire-library report`.
  libboost1.81-dev  # Asio and Beast. It conflicts with Debian's default version, 1.74.
  libcli11-dev
  libeigen3-dev
  libflatbuffers-dev
  libglm-dev
  libhwy-dev
  libspdlog-dev
  libtomlplusplus-dev
  libxxhash-dev
  ninja-build
  nlohmann-json3-dev
  prometheus-cpp-dev
  python3  # Generates code from the schema of the protocol, and runs checks of the source tree.
)
tests=(
  assimp-testmodels  # Contains two motion captures, which the tests and the demo use.
  libbenchmark-dev
  libgmock-dev
  libgtest-dev
  librapidcheck-dev
  mono-mcs  # A test compiles and runs the C# package.
  mono-runtime
  pkgconf  # A test compiles a C program with the flags of the installed package.
  python3-numpy  # The Python package needs it; a test installs the package with pip.
  python3-pip
  python3-setuptools
)
# The web client contains core, protocol and session of the C++ client, compiled to WebAssembly.
build+=(
  clang-19
  libc++-19-dev-wasm32
  libc++abi-19-dev-wasm32
  libclang-rt-19-dev-wasm32
  lld-19
  wasi-libc
)
# The web client and the viewer are built with npm. Debian's npm conflicts with a Node.js from
# another source, so the script installs it only if there is no npm yet.
command -v npm >/dev/null || build+=(nodejs npm)
browser=(
  chromium  # The browser tests of the viewer run in it.
)
lint=(
  clang-format-19
  clang-tidy-19
  codespell  # Checks the spelling for .ci/prose.
  debootstrap  # Installs the bare Debian of .ci/bare_root.
)

usage() { sed -n '2,/^set -euo/{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"; }
fail() { echo "install_deps.sh: $*" >&2; exit "${status:-1}"; }

packages=("${build[@]}" "${tests[@]}")
list=false
with_browser=true
for option in "$@"; do
  case "$option" in
    --lint) packages+=("${lint[@]}") ;;
    --no-browser) with_browser=false ;;
    --list) list=true ;;
    -h | --help) usage; exit 0 ;;
    *) status=2 fail "unknown option '$option' (see --help)" ;;
  esac
done
if $with_browser; then packages+=("${browser[@]}"); fi
if $list; then printf '%s\n' "${packages[@]}"; exit 0; fi

command -v dpkg-query >/dev/null && command -v apt-get >/dev/null ||
  fail "needs Debian 12 (dpkg-query and apt-get); on another system install the packages of --list"

missing=()
for package in "${packages[@]}"; do
  installed=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true)
  [[ $installed == installed ]] || missing+=("$package")
done
if [[ ${#missing[@]} -eq 0 ]]; then exit 0; fi

# Only the versions of Debian 12 are tested. On any other release the script warns and continues.
release=$(. /etc/os-release && echo "${ID:-unknown} ${VERSION_ID:-}")
[[ $release == "debian 12" ]] ||
  echo "install_deps.sh: warning: written for Debian 12, but this is $release" >&2

as_root=()
if [[ $(id -u) -ne 0 ]]; then
  command -v sudo >/dev/null ||
    fail "needs root or sudo; run as root: apt-get install ${missing[*]}"
  as_root=(sudo)
  [[ -t 0 ]] || as_root=(sudo -n)  # Without a terminal, fail instead of waiting for a password.
  "${as_root[@]}" true || fail "sudo failed; run as root: apt-get install ${missing[*]}"
fi

old_boost=$(dpkg-query -W -f '${db:Status-Status}' libboost1.74-dev 2>/dev/null || true)
if [[ " ${missing[*]} " == *" libboost1.81-dev "* && $old_boost == installed ]]; then
  echo "install_deps.sh: libboost1.81-dev replaces libboost1.74-dev, because the two conflict" >&2
fi

log=$(mktemp "${TMPDIR:-/tmp}/stridewire-apt.XXXXXX.log") ||
  fail "cannot create a log file in ${TMPDIR:-/tmp}"
packages_text="${#missing[@]} packages"
if [[ ${#missing[@]} -eq 1 ]]; then packages_text="1 package"; fi
echo "Installing $packages_text (log: $log)" >&2
apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8 apt-get -q -y
     -o Acquire::Retries=3 -o DPkg::Lock::Timeout=300 -o Dpkg::Use-Pty=0)
"${apt[@]}" update >>"$log" 2>&1 ||
  echo "install_deps.sh: warning: apt-get update failed; the package lists may be out of date" >&2
if ! "${apt[@]}" install --no-install-recommends "${missing[@]}" >>"$log" 2>&1; then
  tail -n 20 "$log" >&2
  fail "apt-get failed; the lines above are the end of $log"
fi
