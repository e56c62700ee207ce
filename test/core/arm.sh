#!/usr/bin/env bash
# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# Compile the C++ test for aarch64, run it under qemu, and compare its answers with those of this
# machine: the same bits of verdict, separation and normal.
#
# usage: arm.sh [PYTHON]     (a Python with NumPy; default: .venv/bin/python)
# Needed: g++, and on Debian and Ubuntu `apt install g++-aarch64-linux-gnu qemu-user`.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
python=${1:-$root/.venv/bin/python}
for program in g++ aarch64-linux-gnu-g++ qemu-aarch64 "$python"; do
    command -v "$program" >/dev/null || {
        echo "error: $program is not installed (apt install g++-aarch64-linux-gnu qemu-user)" >&2
        exit 1
    }
done

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
PYTHONPATH=$root/test/core:$root/test/helpers "$python" -c 'import pathlib, sys, test_core_cpp
test_core_cpp.write_families(pathlib.Path(sys.argv[1]))' "$work/families.txt"

flags=(-std=c++17 -O2 -Wall -Wextra -Werror
    "-I$root/box_contact_ros/core/include" "$root/test/core/contact_test.cpp")
g++ -Wno-psabi "${flags[@]}" -o "$work/here" &
here=$!
aarch64-linux-gnu-g++ "${flags[@]}" -o "$work/arm"
wait "$here"

echo "$(uname -m):"
"$work/here" "$work/families.txt" "$work/here.answers"
echo 'aarch64:'
qemu-aarch64 -L /usr/aarch64-linux-gnu "$work/arm" "$work/families.txt" "$work/arm.answers"
cmp "$work/here.answers" "$work/arm.answers"
echo "the same bits of verdict, separation and normal in $(wc -l <"$work/arm.answers") pairs"
