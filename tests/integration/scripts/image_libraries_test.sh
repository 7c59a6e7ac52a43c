#!/usr/bin/env bash
# image_libraries_test.sh DOCKERFILE PROGRAM: checks that the container image installs every package
# whose shared libraries the program is linked with, except those that every Debian image contains.
set -euo pipefail
dockerfile=$1
program=$2
failed=0
found=0
while read -r library; do
  package=$(dpkg-query -S "$(readlink -f "$library")" 2>/dev/null || dpkg-query -S "$library")
  package=${package%%:*}
  found=$((found + 1))
  case "$package" in
    libc6 | libgcc-s1 | libstdc++6 | libasan8 | libubsan1 | libtsan2 | zlib1g) continue ;;
  esac
  grep -qE "^ +$package( |\$)" "$dockerfile" || {
    echo "FAILED: $program needs $library of $package, which the image does not install" >&2
    failed=1
  }
done < <(ldd "$program" | sed -n 's/.*=> \(\/[^ ]*\) .*/\1/p')
[[ $found -gt 0 ]] || { echo "FAILED: ldd names no library of $program" >&2; failed=1; }
exit "$failed"
