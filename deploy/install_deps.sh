#!/usr/bin/env bash
# Installs what Stridewire is built, tested and shown with, from Debian 12's own packages.
# Unattended and repeatable; when everything is there it only asks dpkg and returns at once.
#
#   deploy/install_deps.sh          # to build, test and run the demonstration
#   deploy/install_deps.sh --lint   # also clang-format and clang-tidy, as .ci/run needs them
#   deploy/install_deps.sh --no-browser  # not the browser that the viewer is tested in
#   deploy/install_deps.sh --list   # only print the package names, one a line
set -euo pipefail

build=(
  ca-certificates
  ccache
  cmake
  flatbuffers-compiler
  g++
  git
  gnuplot-nox  # Draws the pictures of `stridewire-library report`.
  libboost1.81-dev  # Asio and Beast. Debian's default 1.74 and this one exclude each other.
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
)
tests=(
  assimp-testmodels  # Two real captures, which the demonstration plays.
  libbenchmark-dev
  libgmock-dev
  libgtest-dev
  librapidcheck-dev
)
# The web client and the viewer are built with npm. Debian's clashes with one installed from elsewhere,
# so it is only asked for where there is none.
command -v npm >/dev/null || build+=(nodejs npm)
browser=(
  chromium  # What the viewer is tested in.
)
lint=(
  clang-format-19
  clang-tidy-19
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
  fail "this needs Debian 12 (dpkg and apt-get); elsewhere install the packages of --list by hand"

missing=()
for package in "${packages[@]}"; do
  installed=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true)
  [[ $installed == installed ]] || missing+=("$package")
done
if [[ ${#missing[@]} -eq 0 ]]; then exit 0; fi

# Debian 12 is what the versions are right for; say so, and let anyone with a newer one try.
release=$(. /etc/os-release && echo "${ID:-unknown} ${VERSION_ID:-}")
[[ $release == "debian 12" ]] ||
  echo "install_deps.sh: made for Debian 12, this is $release; trying all the same" >&2

as_root=()
if [[ $(id -u) -ne 0 ]]; then
  command -v sudo >/dev/null ||
    fail "not root and no sudo; as root run: apt-get install ${missing[*]}"
  as_root=(sudo)
  [[ -t 0 ]] || as_root=(sudo -n)  # Nobody there to type a password: fail instead of waiting.
  "${as_root[@]}" true || fail "sudo refused; as root run: apt-get install ${missing[*]}"
fi

if [[ " ${missing[*]} " == *" libboost1.81-dev "* ]] &&
   [[ $(dpkg-query -W -f '${db:Status-Status}' libboost1.74-dev 2>/dev/null || true) == installed ]]; then
  echo "install_deps.sh: libboost1.81-dev replaces libboost1.74-dev, they exclude each other" >&2
fi

echo "Installing ${#missing[@]} Debian packages: ${missing[*]}" >&2
apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8 apt-get -q -y
     -o Acquire::Retries=3 -o DPkg::Lock::Timeout=300 -o Dpkg::Use-Pty=0)
"${apt[@]}" update >&2 || echo "install_deps.sh: package lists are not all fresh; going on" >&2
"${apt[@]}" install --no-install-recommends "${missing[@]}" >&2 ||
  fail "apt-get could not install everything; its reason is above"
