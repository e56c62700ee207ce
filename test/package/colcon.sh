#!/usr/bin/env bash
# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# Build this checkout with colcon in a new workspace, plain and with --symlink-install, and run its
# tests there as `colcon test` does. The environment has what package.xml needs, as wheels, and no
# extra: tests of extras are skipped by name.
#
# usage: colcon.sh [PYTHON [ARGUMENT OF PYTEST...]]     (default: .venv/bin/python, and the tests of
# what an installation changes)
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
python=$(realpath -s "${1:-$root/.venv/bin/python}")
# What an installation changes: programs, messages, and files that are looked up.
installed=(-m 'not slow' test/package/test_{arguments,help,launch,package,processes,ros2}.py
    test/core/test_library.py test/models/test_{paper,soup,weights_file}.py test/demo/test_demo.py
    test/node/test_{contact_node,msg_schemas,soup_node}.py)
# For hangs alone: half an hour, then ten seconds to end in.
limited=(timeout --kill-after=10 1800)
arguments=("${@:2}")
if [ $# -lt 2 ]; then arguments=("${installed[@]}"); fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
unset PYTHONPATH
export PIP_DISABLE_PIP_VERSION_CHECK=1

# pip's output is shown where pip fails.
install() {
    pip install "$@" >"$work/pip.log" 2>&1 || { tail -n 20 "$work/pip.log" >&2; exit 1; }
}

"$python" -m venv "$work/venv"
cd "$root"
"$python" setup.py -q egg_info --egg-base "$work"
# Before the first section are those that everybody needs.
awk '/^\[/ {other = $0 != "[ros]"; next} !other' "$work"/*.egg-info/requires.txt >"$work/needs.txt"
PATH=$work/venv/bin:$PATH
install --constraint constraints.txt --requirement "$work/needs.txt" \
    setuptools colcon-common-extensions pytest
# Where the wheels' CMake packages are.
export AMENT_PREFIX_PATH=$work/venv CMAKE_PREFIX_PATH=$work/venv

# The working tree: all that git tracks, and what is about to be added.
sources=$work/box_contact_ros
mkdir "$sources"
git -c safe.directory='*' ls-files -z --cached --others --exclude-standard |
    while IFS= read -r -d '' file; do if [ -e "$file" ]; then printf '%s\0' "$file"; fi; done |
    xargs -0 cp --parents --target-directory "$sources"

# Run what a user's package installed, as a user does: in a sourced shell. Only ROS's own libraries,
# which are wheels here, are in no place that a hook names.
linked() {
    (
        set +u
        source install/setup.bash
        export LD_LIBRARY_PATH=$LD_LIBRARY_PATH:$work/venv/lib
        for program in install/linked/lib/linked/*; do
            [ "$("$program")" = 'landing: 0.010 m deep, 25.58 m2, the same' ]
        done
    )
}

# Build and test in a workspace; $1 is its name, the others are options of the build.
workspace() {
    mkdir -p "$work/$1/src"
    cp -r "$sources" "$work/$1/src/"
    cd "$work/$1"
    ln -s box_contact_ros/box_contact_msgs src/box_contact_msgs
    cp -r src/box_contact_ros/test/package/linked src/linked
    "${limited[@]}" colcon build "${@:2}"
    linked
    # A second build compiles nothing.
    local library=install/box_contact_ros/lib/libbox_contact.so before
    before=$(stat --dereference --format %Y "$library")
    "${limited[@]}" colcon build "${@:2}" --packages-select box_contact_ros
    [ "$(stat --dereference --format %Y "$library")" = "$before" ]
    # Where `ros2 run` and `ros2 launch` look.
    ls install/box_contact_ros/{lib/box_contact_ros/contact_node,share/box_contact_ros/package.xml}
    # Of a run that a crash ends, the results say nothing: its output does.
    "${limited[@]}" colcon test --packages-select box_contact_ros \
        --event-handlers console_cohesion+ --pytest-args "${arguments[@]}"
    colcon test-result --verbose
}

# One after the other: the tests of both at once keep nodes from the two cores that there may be.
failed=
try() {
    local mode=$1
    workspace "$@" >"$work/$mode.log" 2>&1 &  # a shell of its own, which an error ends
    if wait $! && result=$(grep '^Summary: [1-9].* tests' "$work/$mode.log"); then
        echo "colcon, $mode: $result"
    else
        failed=1
        echo "colcon, $mode: failed; the end of its output:" >&2
        tail -n 100 "$work/$mode.log" >&2
    fi
}
try plain
try symlink --symlink-install
if [ "$failed" ]; then exit 1; fi
echo 'colcon builds and tests the package, plain and with --symlink-install'
